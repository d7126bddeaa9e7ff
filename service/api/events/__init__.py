"""Jobs' events: read from Redis once, and sent to everyone who watches."""
