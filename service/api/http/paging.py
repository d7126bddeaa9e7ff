"""Pages of a list: where one ends and the next begins, as clients hand it back."""

from typing import Annotated

from fastapi import Query

#: Where a page begins, as a route takes it.
Cursor = Annotated[
    str | None,
    Query(
        pattern="^[0-9]{1,15}$",
        description="`next_cursor` of the page before",
        examples=["42"],
    ),
]


def number_of(cursor: str | None) -> int | None:
    """The number below which the page begins; None for the first page."""
    return None if cursor is None else int(cursor)


def cursor_of(number: int | None) -> str | None:
    """The cursor of a page that begins below the number; None where there is none."""
    return None if number is None else str(number)
