"""Redis itself: the connection, its keys, its scripts and users, and the embedded server.

`plateau.farm.ledger` has the records in it, docs/decisions/storage.md the reasons.
"""
