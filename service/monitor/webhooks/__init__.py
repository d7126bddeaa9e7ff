"""The delivery of webhooks. The reasons are in docs/decisions/api.md."""
