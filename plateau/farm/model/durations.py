"""Histograms of durations that only grow, as Prometheus needs them."""

import time
from bisect import bisect_left
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass


@dataclass(frozen=True)
class Histogram:
    """The number of runs up to each bound, and the total time of all runs."""

    buckets: tuple[tuple[float, int], ...]  #: (bound in s, runs up to it), the last bound infinite
    sum_s: float


class Durations:
    """The durations of many runs of one thing, noted by one thread and read by any."""

    def __init__(self, bounds_s: tuple[float, ...]) -> None:
        self._bounds_s = (*bounds_s, float("inf"))
        self._runs = [0] * len(self._bounds_s)
        self._sum_us = 0

    def note(self, seconds: float) -> None:
        """Note one run."""
        self._runs[bisect_left(self._bounds_s, seconds)] += 1
        self._sum_us += round(seconds * 1e6)

    @contextmanager
    def timed(self) -> Iterator[None]:
        """Note the duration of the context, unless it ends with an error."""
        started = time.monotonic()
        yield
        self.note(time.monotonic() - started)

    def numbers(self, name: str) -> dict[str, int]:
        """The noted runs as numbers that can be added: the runs of each bucket, and µs in all."""
        runs = zip(self._bounds_s, self._runs, strict=True)
        return {f"{name} le {bound:g}": n for bound, n in runs} | {f"{name} us": self._sum_us}


def histogram(numbers: Mapping[str, int], name: str, bounds_s: tuple[float, ...]) -> Histogram:
    """The histogram of the sums of `Durations.numbers` under this name, with these bounds."""
    runs = dict.fromkeys((*bounds_s, float("inf")), 0)
    for key, number in numbers.items():
        start, le, bound = key.rpartition(" le ")
        if le and start == name:
            runs[float(bound)] = number
    total, buckets = 0, []
    for bound_s in sorted(runs):
        total += runs[bound_s]
        buckets.append((bound_s, total))
    return Histogram(tuple(buckets), numbers.get(f"{name} us", 0) / 1e6)
