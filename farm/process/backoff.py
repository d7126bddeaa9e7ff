"""How long to wait before trying again what failed because something was away."""

import random


class Backoff:
    """Delays that double up to a limit, each spread by half, so that a farm does not retry as one.

    Parameters
    ----------
    first_s, longest_s
        The first delay and the longest, in seconds, before they are spread.
    """

    def __init__(self, first_s: float, longest_s: float) -> None:
        self._first_s = first_s
        self._longest_s = longest_s
        self._next_s = first_s

    def delay_s(self) -> float:
        """The next delay in seconds; the one after it is twice as long."""
        delay_s = self._next_s * random.uniform(0.5, 1.5)
        self._next_s = min(2 * self._next_s, self._longest_s)
        return delay_s

    def reset(self) -> None:
        """Begin again with the first delay: it worked."""
        self._next_s = self._first_s
