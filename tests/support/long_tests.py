"""Which form of the tests is wanted.

`make test` runs neither long nor rare cases, `make test-rare` the rare ones, which pytest marks
`long`; ``make test-faults`` and ``make test-long`` ask for long forms by LONG_TESTS.
"""

import os
from collections.abc import Collection, Iterable
from typing import Any

import pytest

WANTED = "LONG_TESTS" in os.environ


def rare(*every: Any) -> list[Any]:
    """Cases that `make test` leaves out."""
    values = (case if isinstance(case, tuple) else (case,) for case in every)
    return [pytest.param(*one, marks=pytest.mark.long) for one in values]


def rare_among(every: Iterable[str], dear: Collection[str]) -> list[Any]:
    """All cases, of which `make test` leaves out those that are dear."""
    return [one for name in every for one in (rare(name) if name in dear else [name])]


def cases(every: Iterable[Any], short: Iterable[Any]) -> list[Any]:
    """All cases in the long form; else a few of them."""
    return list(every if WANTED else short)
