"""Parameters that several routes share: the media type, the page of a list, a batch's name."""

import re
from typing import Annotated, Final
from urllib.parse import unquote

from fastapi import Depends, Path, Query

from plateau.service.api.problems.catalogue import NOT_ACCEPTABLE
from plateau.service.api.problems.problem import Problem

_QUALITY: Final = re.compile(r";[ \t]*q=([01](?:\.[0-9]{0,3})?)[ \t]*(?:;|$)", re.IGNORECASE)


def chosen(accept: str, offers: tuple[str, ...]) -> str:
    """The media type of these offers that the client prefers; the first wins a tie.

    `accept` is the header's value; empty, it accepts all. Raises the problem if no offer is
    acceptable. The most specific range that matches a type gives its quality (RFC 9110, section
    12.5.1).
    """
    ranges = dict(_range(part) for part in accept.split(",") if part.strip()) or {"*/*": 1.0}
    best = max(offers, key=lambda offer: _quality(offer, ranges))  # the first of equals
    if _quality(best, ranges) == 0:
        raise Problem(NOT_ACCEPTABLE, types=" or ".join(offers), accept=accept, offers=offers)
    return best


def _range(part: str) -> tuple[str, float]:
    quality = _QUALITY.search(part)
    return part.partition(";")[0].strip().lower(), float(quality[1]) if quality else 1.0


def _quality(offer: str, ranges: dict[str, float]) -> float:
    for pattern in (offer, f"{offer.partition('/')[0]}/*", "*/*"):
        if pattern in ranges:
            return ranges[pattern]
    return 0.0


#: The start of a page, as a route takes it.
Cursor = Annotated[
    str | None,
    Query(pattern="^[0-9]{1,15}$", description="`next_cursor` of the page before", examples=["42"]),
]


def number_of(cursor: str | None) -> int | None:
    """The number below which the page starts; None for the first page."""
    return None if cursor is None else int(cursor)


def cursor_of(number: int | None) -> str | None:
    """The cursor of the page that starts below the number; None after the last page."""
    return None if number is None else str(number)


def _name(
    name: Annotated[
        str,
        Path(
            description="the batch's name, percent-encoded: a `/` in it is `%2F`",
            examples=["exposures"],
        ),
    ],
) -> str:
    return unquote(name)


#: A batch's name, as a route takes it; `layers.KeepSlashes` kept it encoded until here.
BatchName = Annotated[str, Depends(_name)]
