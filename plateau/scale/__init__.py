"""Workers that are started and ended with the queue, as jobs of a batch system."""
