"""Worker processes that come and go with the queue, as jobs of a batch system."""
