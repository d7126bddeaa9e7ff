"""RFC 9457 problem details: the form of every error of the API."""
