"""Delays between tries while a service is away."""

import random


class Backoff:
    """Delays that double from `first_s` up to `longest_s`.

    A jitter of half spreads each delay, so that a farm's processes do not retry at once.
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
        """Begin again with the first delay, after a success."""
        self._next_s = self._first_s
