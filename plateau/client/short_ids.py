"""Shortened ids of jobs, as in git."""

import re
from collections.abc import Callable, Iterable
from itertools import islice
from typing import Final

from plateau.client.errors import BadId
from plateau.farm.model.job import Job
from plateau.farm.model.spec import JobSpec

_PREFIX: Final = re.compile(r"[0-9a-f]{4,11}")
#: A prefix is searched among this many of the newest jobs.
_NEWEST: Final = 1000
_SHOWN: Final = 5


def whole_id(given: str, jobs: Iterable[Job]) -> str:
    """The id of the only recent job with this prefix; anything but a prefix is returned unchanged.

    `jobs` are all jobs, newest first, read only for a prefix. Raises `BadId` unless one has it.
    """
    if not _PREFIX.fullmatch(given):
        return given
    newest = [job.id for job in islice(jobs, _NEWEST)]
    found = [job_id for job_id in newest if job_id.startswith(given)]
    if not found:
        among = f" of the newest {_NEWEST:,}" if len(newest) == _NEWEST else ""
        raise BadId(f"no job{among} has an id that begins with {given}; see `plateau list`")
    if len(found) > 1:
        more = ", …" if len(found) > _SHOWN else ""
        raise BadId(f"{given} may be {', '.join(found[:_SHOWN])}{more}: give more of it")
    return found[0]


def with_whole_ids(spec: JobSpec, whole: Callable[[str], str]) -> JobSpec:
    """The spec with whole ids of the jobs that it comes after; batches keep their names.

    `whole` returns the id of a prefix, or raises `BadId`.
    """
    return spec.model_copy(
        update={"after": tuple(job_or_batch(name, whole) for name in spec.after)}
    )


def job_or_batch(name: str, whole: Callable[[str], str]) -> str:
    """The whole id of a job, or the name of a batch as it is."""
    try:
        return whole(name)
    except BadId:
        return name  # the service says if it is no batch, either
