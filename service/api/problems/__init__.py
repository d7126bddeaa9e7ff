"""RFC 9457 problem details: what every error of the API looks like."""
