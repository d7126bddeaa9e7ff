"""Redis itself: the connection, its keys, its scripts and users, and the embedded server.

What is kept there is in `plateau.farm.ledger`.

The reasons are in docs/decisions/redis.md.
"""
