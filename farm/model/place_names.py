"""The names of pools and tags."""

from typing import Annotated, Final

from pydantic import AfterValidator, Field

#: The pool of workers and jobs that name none.
DEFAULT_POOL: Final = "default"

PlaceName = Annotated[
    str, Field(min_length=1, max_length=40, pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$")
]


def _in_order(names: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(sorted(set(names)))


#: Sorted, each once.
Tags = Annotated[tuple[PlaceName, ...], Field(max_length=16), AfterValidator(_in_order)]
