"""Rows of an image, shared among threads: no result depends on how many there are.

Kernels work without the interpreter's lock. One writes what its rows are, and reads of the others
only what it does not write.
"""

import os
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from functools import cache
from itertools import pairwise
from typing import Any, Final, TypeVar

_Result = TypeVar("_Result")

#: The most threads: beyond it memory is what they wait for.
MOST: Final = 12
#: The fewest pixels that are worth a thread.
LEAST_PIXELS: Final = 2**16


def by_rows(kernel: Callable[..., object], shape: tuple[int, ...], *arguments: Any) -> None:
    """Call ``kernel(first, last, *arguments)`` for all rows of an image, (…, H, W), in shares."""
    height, width = shape[-2:]
    shares = max(1, min(_threads(), height, height * width // LEAST_PIXELS))
    bounds = [height * share // shares for share in range(shares + 1)]
    own, *rest = pairwise(bounds)
    others = [_pool().submit(kernel, *rows, *arguments) for rows in rest]
    kernel(*own, *arguments)
    for other in others:
        other.result()


def beside(task: Callable[[], _Result]) -> Future[_Result]:
    """Begin a task beside the caller's own work, with rows of its own."""
    return _companion().submit(task)


@cache
def _threads() -> int:
    return min(MOST, len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 1)


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(MOST, thread_name_prefix="rows")


@cache
def _companion() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(2, thread_name_prefix="beside")


# A forked process has none of its parent's threads.
os.register_at_fork(after_in_child=_pool.cache_clear)
os.register_at_fork(after_in_child=_companion.cache_clear)
