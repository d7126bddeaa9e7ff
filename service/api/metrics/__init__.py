"""What ``GET /metrics`` says, in Prometheus's format."""
