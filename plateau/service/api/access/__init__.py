"""Who may make a request: its origin, its key, and the key's rate limit.

The reasons are in docs/decisions/api.md.
"""
