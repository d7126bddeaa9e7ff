"""How often a client waits for Redis.

Redis's own count of reads is not that: it may read in parts what was sent at once.
"""

from collections.abc import Callable
from unittest.mock import patch

from redis.connection import AbstractConnection


def round_trips(work: Callable[[], object]) -> int:
    """Return how often something is sent to Redis while this process does the work."""
    method = "send_packed_command"
    real = getattr(AbstractConnection, method)
    with patch.object(AbstractConnection, method, autospec=True, side_effect=real) as sent:
        work()
    return sent.call_count
