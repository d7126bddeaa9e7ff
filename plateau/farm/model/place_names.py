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


#: The most tags of a job, or of a worker's settings.
MOST_TAGS: Final = 16

#: Sorted, each once.
Tags = Annotated[tuple[PlaceName, ...], Field(max_length=MOST_TAGS), AfterValidator(_in_order)]
