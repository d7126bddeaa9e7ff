"""The names of pools and tags, and those of workers."""

from typing import Annotated, Final

from pydantic import AfterValidator, Field

#: The pool of workers and jobs that name none.
DEFAULT_POOL: Final = "default"

PlaceName = Annotated[
    str, Field(min_length=1, max_length=40, pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$")
]


def _in_order(names: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(sorted(set(names)))


#: A worker by its id, or all workers of a machine by its host name.
WorkerName = Annotated[
    str, Field(min_length=1, max_length=100, pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$")
]

#: The most workers that are blocked for a job.
MOST_BLOCKED: Final = 16

WorkerNames = Annotated[
    tuple[WorkerName, ...], Field(max_length=MOST_BLOCKED), AfterValidator(_in_order)
]

#: The most tags of a job, or of a worker's settings.
MOST_TAGS: Final = 16

#: Sorted, each once.
Tags = Annotated[tuple[PlaceName, ...], Field(max_length=MOST_TAGS), AfterValidator(_in_order)]
