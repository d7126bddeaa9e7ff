"""HTTP as the API uses it: the server, connections, caching and headers."""
