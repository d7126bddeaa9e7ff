"""Which form of the long tests is wanted: ``make test-faults`` and ``make test-long`` set it."""

import os
from collections.abc import Iterable
from typing import TypeVar

WANTED = "LONG_TESTS" in os.environ

Case = TypeVar("Case")


def cases(every: Iterable[Case], short: Iterable[Case]) -> list[Case]:
    """All cases in the long form, a few of them in the short one, which CI runs."""
    return list(every if WANTED else short)
