"""Parameters that several routes share: the page of a list, a batch's name."""

from typing import Annotated
from urllib.parse import unquote

from fastapi import Depends, Path, Query

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
