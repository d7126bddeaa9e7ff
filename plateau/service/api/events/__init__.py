"""Jobs' events: read from Redis once, and sent to every watcher."""
