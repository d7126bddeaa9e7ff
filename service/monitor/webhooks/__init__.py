"""The delivery of webhooks: threads of a monitor, and the requests that they make.

The reasons are in docs/decisions/webhooks.md.
"""
