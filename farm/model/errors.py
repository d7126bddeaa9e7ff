"""The errors of `farm`.

::

    FarmError
    ├── JobNotFound        no job of that id
    ├── UnreadableJob      this Plateau cannot read the job's data in Redis
    ├── IllegalTransition  the job's state does not allow this move; carries its story
    ├── BatchNotFound      no batch of that name
    ├── JobEnded           the job has ended and cannot be changed any more; carries its story
    ├── JobNotEnded        the job has not ended, so it cannot be archived or deleted
    ├── CannotContinue     no job can continue this one in the wanted way
    ├── CannotFollow       no job can wait for this job or batch
    ├── FenceLost          another monitor owns the job now
    ├── WorkerNotFound     no worker of that id lives
    ├── TooManyJobs        the API key has as many open jobs as it may
    ├── TooManyNeeds       open jobs need too many different pools, tags and blocked workers
    ├── TooManyBlocked     as many workers are blocked for a job as may be
    ├── UnknownKey         no API key of that id, or it was revoked
    ├── StoreUnavailable   Redis or the blob store cannot be reached, or refuses
    │   ├── BlobsUnavailable   the blob store does
    │   └── NotPermitted       Redis does not permit a command to this process's user
    ├── WrongStore         the blob store does not belong to this Redis, or cannot be one
    ├── Incompatible       this Plateau cannot work on the farm that it is to join
    │   ├── SchemaMismatch     it cannot work with the layout of the data in Redis
    │   ├── WrongLayout        another Plateau has changed the layout meanwhile
    │   ├── OldProcesses       a migration would shut out processes that live
    │   └── Refused            the farm speaks other versions of the protocol
    ├── FilesDiffer        this machine does not have the files of a scene root that a job names
    └── CorruptBlob        a blob does not match its name
        └── CorruptPartial     a partial does not match its ledger record
"""

from plateau.farm.model import versions


class FarmError(Exception):
    """The base of all errors of `farm`."""


class JobNotFound(FarmError):
    """There is no job of this id."""

    def __init__(self, job_id: str) -> None:
        super().__init__(f"there is no job {job_id!r}")
        self.job_id = job_id


class UnreadableJob(FarmError):
    """This Plateau cannot read the job's data in Redis."""

    def __init__(self, job_id: str, error: Exception) -> None:
        why = f"it has no {error}" if isinstance(error, KeyError) else str(error)
        super().__init__(f"this Plateau cannot read job {job_id}: {why}")
        self.job_id = job_id


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
        self.name = name


class JobEnded(FarmError):
    """The job has ended and cannot be changed any more."""

    def __init__(self, job_id: str, state: str, story: tuple[str, ...] = ()) -> None:
        super().__init__("\n  ".join([f"job {job_id} is {state}: it has ended", *story]))
        self.job_id = job_id
        self.state = state
        self.story = story


class JobNotEnded(FarmError):
    """The job has not ended, so it cannot be archived or deleted."""

    def __init__(self, job_id: str, state: str) -> None:
        super().__init__(f"job {job_id} is {state}: it has not ended")
        self.job_id = job_id
        self.state = state


class WorkerNotFound(FarmError):
    """No worker of this id lives."""

    def __init__(self, worker_id: str) -> None:
        super().__init__(f"there is no worker {worker_id!r}")
        self.worker_id = worker_id


class CannotContinue(FarmError):
    """No job can continue this one, or not in the wanted way; the message says why."""

    def __init__(self, job_id: str, why: str) -> None:
        super().__init__(f"job {job_id} cannot be continued: {why}")
        self.job_id = job_id


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
        self.job_id = job_id


class TooManyJobs(FarmError):
    """The key has as many jobs that have not ended as it may have."""

    def __init__(self, open_jobs: int, most: int) -> None:
        super().__init__(
            f"the key has {open_jobs:,} jobs that have not ended, and may have {most:,}"
        )
        self.open_jobs = open_jobs
        self.most = most


class TooManyNeeds(FarmError):
    """Open jobs need as many different workers as they may: by pool, tags and blocks."""

    def __init__(self, most: int) -> None:
        super().__init__(
            f"jobs that have not ended need {most} different combinations of pool, tags and "
            "blocked workers, which is the most that a farm takes"
        )


class TooManyBlocked(FarmError):
    """As many workers are blocked for the job as may be."""

    def __init__(self, job_id: str, has: int) -> None:
        super().__init__(f"{has} workers are blocked for job {job_id}, and no more can be")
        self.job_id = job_id


class UnknownKey(FarmError):
    """There is no API key of this id, or it was revoked."""


class StoreUnavailable(FarmError):
    """Redis or the blob store cannot be reached."""


class BlobsUnavailable(StoreUnavailable):
    """The blob store cannot be reached, is full, or refuses."""


class NotPermitted(StoreUnavailable):
    """Redis does not permit a command to this process's user; see `plateau.farm.redis.acl`.

    As when Redis is away, no job fails for it: the ACL file may be one of an older Plateau, and
    work continues once it is replaced.
    """

    def __init__(self, said: str) -> None:
        super().__init__(
            f"Redis does not let this user do that ({said}): let this process be the user that is "
            "meant for it, and Redis have the ACL file that `plateau redis-acl` of this Plateau "
            "writes"
        )


class WrongStore(FarmError):
    """The blob store does not belong to this Redis, or lacks a feature that it must have."""


class Incompatible(FarmError):
    """This Plateau cannot work on the farm that it is to join; the message says what to do."""


class SchemaMismatch(Incompatible):
    """This Plateau cannot work with the layout of the data in Redis."""


def needs_other_layout(found: str) -> str:
    """The beginning of each message about data of another layout."""
    return (
        f"the data in Redis has layout {found}, and this Plateau, {versions.plateau()}, works with "
        f"layout {versions.LAYOUT}"
    )


class WrongLayout(Incompatible):
    """The data in Redis has another layout than this Plateau's; nothing was done."""

    def __init__(self, found: str) -> None:
        newer = found.isdigit() and int(found) > versions.LAYOUT
        what_to_do = (
            "a newer Plateau has migrated it; install that version here"
            if newer
            else "start a monitor or an API of this Plateau, which migrates it"
        )
        super().__init__(f"{needs_other_layout(found)}: {what_to_do}. Nothing was changed")


class OldProcesses(Incompatible):
    """A migration would shut out processes that live."""

    def __init__(self, found: str, who: tuple[str, ...]) -> None:
        super().__init__(
            f"{needs_other_layout(found)}. This one cannot migrate the data while these processes "
            f"work with it as it is: {', '.join(who)}. Stop them, then start this one again. "
            "Nothing was changed"
        )
        self.who = who


class Refused(Incompatible):
    """The farm speaks other versions of the protocol than this process."""

    def __init__(self, oldest: int, newest: int, plateau: str) -> None:
        #: whether the process is too old, not too new
        self.too_old = oldest > versions.NEWEST
        what_to_do = (
            f"too old: install Plateau {plateau} here"
            if self.too_old
            else f"too new: upgrade the farm's monitors and APIs to Plateau {versions.plateau()} "
            f"first, or install Plateau {plateau} here"
        )
        super().__init__(
            f"the farm's monitors and APIs speak {versions.spoken(oldest, newest)} (Plateau "
            f"{plateau}), and this process speaks "
            f"{versions.spoken(versions.OLDEST, versions.NEWEST)} (Plateau {versions.plateau()}). "
            f"It is {what_to_do}"
        )


class FilesDiffer(FarmError):
    """This machine does not have the files of a scene root that a job names; others may."""


class CorruptBlob(FarmError):
    """A blob does not match its name."""


class CorruptPartial(CorruptBlob):
    """A partial does not match its ledger record."""
