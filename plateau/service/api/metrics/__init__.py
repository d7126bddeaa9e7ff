"""``GET /metrics``, in Prometheus's format."""
