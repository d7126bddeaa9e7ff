"""The errors of `farm`.

::

    FarmError
    ├── JobNotFound        no job of that id
    ├── UnreadableJob      this Plateau cannot read the job's data in Redis
    ├── IllegalTransition  the job's state does not allow this move; carries its story
    ├── BatchNotFound      no batch of that name
    ├── JobEnded           the job has ended and cannot be changed any more; carries its story
    ├── JobNotEnded        the job has not ended, so it cannot be deleted or rendered again
    ├── CannotFollow       no job can wait for this job or batch
    ├── FenceLost          another monitor owns the job now
    ├── WorkerNotFound     no worker of that id lives
    ├── TooManyJobs        the API key has as many open jobs as it may
    ├── TooManyNeeds       open jobs need too many different pools and tags
    ├── UnknownKey         no API key of that id, or it was revoked
    ├── StoreUnavailable   Redis or the blob store cannot be reached, or refuses
    │   ├── BlobsUnavailable   the blob store does
    │   ├── NotPermitted       Redis does not permit a command to this process's user
    │   └── WrongPassword      Redis does not let this process in
    ├── WrongStore         the blob store does not belong to this Redis, or cannot be one
    ├── Incompatible       the data in Redis has another layout than this Plateau's
    ├── InvalidSpec        a field of a spec is unknown, or its value is not allowed
    ├── FilesDiffer        this machine does not have the files of a scene root that a job names
    └── CorruptBlob        a blob does not match its name
        └── CorruptPartial     a partial does not match its ledger record
"""

from plateau.farm.model import versions
from plateau.farm.model.states import JobState


class FarmError(Exception):
    """The base of all errors of `farm`."""


class JobNotFound(FarmError):
    """There is no job of this id."""

    def __init__(self, job_id: str) -> None:
        super().__init__(f"there is no job {job_id!r}")


class UnreadableJob(FarmError):
    """This Plateau cannot read the job's data in Redis."""

    def __init__(self, job_id: str, error: Exception) -> None:
        why = f"it has no {error}" if isinstance(error, KeyError) else str(error)
        super().__init__(f"this Plateau cannot read job {job_id}: {why}")


class IllegalTransition(FarmError):
    """The job's state does not allow this move."""

    def __init__(self, job_id: str, state: str, target: str, story: tuple[str, ...] = ()) -> None:
        lines = [f"job {job_id} is {state} and cannot become {target}", *story]
        super().__init__("\n  ".join(lines))
        self.job_id = job_id
        self.state = state
        self.target = target
        self.story = story


class BatchNotFound(FarmError):
    """There is no batch of this name."""

    def __init__(self, name: str) -> None:
        super().__init__(f"there is no batch {name!r}")


class JobEnded(FarmError):
    """The job has ended and cannot be changed any more."""

    def __init__(self, job_id: str, state: str, story: tuple[str, ...] = ()) -> None:
        super().__init__("\n  ".join([f"job {job_id} is {state}: it has ended", *story]))
        self.job_id = job_id
        self.state = state
        self.story = story


class JobNotEnded(FarmError):
    """The job has not ended, or its results are being written."""

    def __init__(self, job_id: str, state: str) -> None:
        is_ended = JobState(state).ended
        why = "its results are being written" if is_ended else "it has not ended"
        super().__init__(f"job {job_id} is {state}: {why}")
        self.job_id = job_id
        self.state = state


class WorkerNotFound(FarmError):
    """No worker of this id lives."""

    def __init__(self, worker_id: str) -> None:
        super().__init__(f"there is no worker {worker_id!r}")


class CannotFollow(FarmError):
    """No job can wait for this job or batch to end well."""

    def __init__(self, name: str, state: str) -> None:
        known = {
            "missing": f"there is no job and no batch {name!r}",
            "deleted": f"job {name} was deleted; restore it first",
            "failed": f"{name} failed, so nothing can come after it",
            "cancelled": f"{name} was cancelled, so nothing can come after it",
            "lost": f"Redis has lost {name}",
        }
        super().__init__(known[state])


class FenceLost(FarmError):
    """This monitor no longer owns the job: its lease ran out and another took over."""

    def __init__(self, job_id: str) -> None:
        super().__init__(f"job {job_id} is owned by another monitor now")


class TooManyJobs(FarmError):
    """The key has as many jobs that have not ended as it may have."""

    def __init__(self, open_jobs: int, most: int) -> None:
        super().__init__(
            f"the key has {open_jobs:,} jobs that have not ended, and may have {most:,}"
        )
        self.open_jobs = open_jobs
        self.limit = most


class TooManyNeeds(FarmError):
    """Open jobs need as many different workers as they may: by pool and tags."""

    def __init__(self, most: int) -> None:
        super().__init__(
            f"jobs that have not ended need {most} different combinations of pool and tags, "
            "which is the most that a farm takes"
        )


class UnknownKey(FarmError):
    """There is no API key of this id, or it was revoked."""


class StoreUnavailable(FarmError):
    """Redis or the blob store cannot be reached."""


class BlobsUnavailable(StoreUnavailable):
    """The blob store cannot be reached, is full, or refuses."""


class NotPermitted(StoreUnavailable):
    """Redis does not permit a command to this process's user; see `plateau.farm.redis.acl`.

    As when Redis is away, no job fails for it: work continues once the ACL file is replaced.
    """

    def __init__(self, said: str) -> None:
        super().__init__(
            f"Redis does not let this user do that ({said}): let this process be the user that is "
            "meant for it, and Redis have the ACL file that `plateau redis-acl` of this Plateau "
            "writes"
        )


class WrongPassword(StoreUnavailable):
    """Redis does not let this process in."""


class WrongStore(FarmError):
    """The blob store does not belong to this Redis, or lacks a feature that it must have."""


class Incompatible(FarmError):
    """The data in Redis has another layout than this Plateau's; nothing was done."""

    def __init__(self, found: str) -> None:
        if found.isdigit():
            why = (
                f"the data in Redis has layout {found}, and this Plateau, {versions.plateau()}, "
                f"works with layout {versions.LAYOUT}: install the Plateau that wrote it, or "
                "choose another PLATEAU_DATA or PLATEAU_REDIS_URL"
            )
        else:
            why = (
                f"Redis has data of layout {found!r}, which is none of Plateau's: set "
                "PLATEAU_REDIS_URL or PLATEAU_DATA to a Redis or a folder that only Plateau uses"
            )
        super().__init__(f"{why}. Nothing was changed")


class InvalidSpec(FarmError, ValueError):
    """A field of a spec is unknown, or has a value that is not allowed."""


class FilesDiffer(FarmError):
    """This machine does not have the files of a scene root that a job names; others may."""


class CorruptBlob(FarmError):
    """A blob does not match its name."""


class CorruptPartial(CorruptBlob):
    """A partial does not match its ledger record."""
