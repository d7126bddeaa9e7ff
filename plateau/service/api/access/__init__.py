"""Who may make a request: its origin, and its key.

The reasons are in docs/decisions/api.md.
"""
