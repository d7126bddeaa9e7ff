"""Who may make a request: where it comes from, its key, and how often the key may be used.

The reasons are in docs/decisions/access.md.
"""
