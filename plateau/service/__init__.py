"""The HTTP API and the monitor."""
