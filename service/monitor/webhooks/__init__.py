"""The delivery of webhooks. The reasons are in docs/decisions/webhooks.md."""
