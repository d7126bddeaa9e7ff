"""The delivery of webhooks: threads of a monitor, and the requests that they make."""
