"""Everything that `farm` raises on purpose.

::

    FarmError
    ├── JobNotFound        no job of that id
    ├── UnreadableJob      what Redis has of the job is nothing that this Plateau knows
    ├── IllegalTransition  the job's state does not allow this move; carries its story
    ├── BatchNotFound      no batch of that name
    ├── UnevenBatch        a guarded batch has other jobs than the one that is to join it
    ├── JobEnded           the job has ended and cannot be changed any more; carries its story
    ├── CannotContinue     no job can go on with this one so
    ├── FenceLost          another monitor owns the job now
    ├── WorkerNotFound     no worker of that id lives
    ├── TooManyJobs        the key that asks for a job has as many open ones as it may
    ├── TooManyNeeds       open jobs need too many different pools and tags for another
    ├── UnknownKey         no API key of that id that could be changed so
    ├── StoreUnavailable   Redis or the blob store cannot be reached, or refuses
    │   ├── BlobsUnavailable   of the two, the blob store
    │   └── NotPermitted       Redis does not let this process's user do what it asks
    ├── WrongStore         the blob store is not the one that belongs to this Redis, or cannot be
    ├── Incompatible       this Plateau cannot work on the farm that it is to join
    │   ├── SchemaMismatch     the data in Redis is of a layout that it cannot work with
    │   ├── WrongLayout        nor any more: another Plateau has changed the layout meanwhile
    │   ├── OldProcesses       it would bring the layout forward, but others need it as it is
    │   └── Refused            the farm speaks other versions of the protocol
    └── CorruptBlob        a blob is not what its name says
        └── CorruptPartial     a partial is not what its ledger entry says
"""

from plateau.farm.model import versions


class FarmError(Exception):
    """Something in the contract between Plateau's processes did not hold."""


class JobNotFound(FarmError):
    """There is no job of this id."""

    def __init__(self, job_id: str) -> None:
        super().__init__(f"there is no job {job_id!r}")
        self.job_id = job_id


class UnreadableJob(FarmError):
    """What Redis has of the job is nothing that this Plateau knows."""

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
    """There is no job of this batch."""

    def __init__(self, name: str) -> None:
        super().__init__(f"there is no batch {name!r}")
        self.name = name


def _value(value: object) -> str:
    """A field's value as people write it."""
    return "not set" if value is None else str(value)


class UnevenBatch(FarmError):
    """A guarded batch has only jobs that stop alike.

    Attributes
    ----------
    batch, job_id
        The batch, and the job of it that is otherwise.
    differs
        The fields in which they differ: name, value asked for, value of that job.
    joins
        Whether a job was to join it; else the batch was to be guarded, and it is its newest job
        that has the values asked for.
    """

    def __init__(
        self,
        batch: str,
        job_id: str,
        differs: list[tuple[str, object, object]],
        *,
        joins: bool = True,
    ) -> None:
        if joins:
            why = "is guarded against flicker, so its jobs must stop alike; this one differs from"
            here, there = "here", "there"
        else:
            why = "cannot be guarded against flicker, since its jobs do not stop alike; see"
            here, there = "in its newest job", "there"
        words = (
            f"{name} is {_value(asked)} {here}, and {_value(had)} {there}"
            for name, asked, had in differs
        )
        super().__init__(f"batch {batch!r} {why} job {job_id}: {'; '.join(words)}")
        self.joins = joins
        self.batch = batch
        self.job_id = job_id
        self.differs = differs


class JobEnded(FarmError):
    """The job has ended: what it asks for cannot be changed any more."""

    def __init__(self, job_id: str, state: str, story: tuple[str, ...] = ()) -> None:
        super().__init__("\n  ".join([f"job {job_id} is {state}: it has ended", *story]))
        self.job_id = job_id
        self.state = state
        self.story = story


class WorkerNotFound(FarmError):
    """No worker of this id lives."""

    def __init__(self, worker_id: str) -> None:
        super().__init__(f"there is no worker {worker_id!r}")
        self.worker_id = worker_id


class CannotContinue(FarmError):
    """No job can go on with this one, or not so; the message says why."""

    def __init__(self, job_id: str, why: str) -> None:
        super().__init__(f"job {job_id} cannot be continued: {why}")
        self.job_id = job_id


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
    """Open jobs need as many different pools and tags of workers as they may."""

    def __init__(self, most: int) -> None:
        super().__init__(
            f"jobs that have not ended need {most} different combinations of pool and tags of "
            "workers, which is the most that a farm takes"
        )


class UnknownKey(FarmError):
    """There is no API key of this id, or it was revoked."""


class StoreUnavailable(FarmError):
    """Redis or the blob store cannot be reached."""


class BlobsUnavailable(StoreUnavailable):
    """The blob store cannot be reached, is full, or refuses."""


class NotPermitted(StoreUnavailable):
    """Redis does not let this process's user do what it asks; see `plateau.farm.redis.acl`.

    As when Redis is away, nobody fails a job for it: a newer Plateau may have met an older ACL
    file, and goes on when that is mended.
    """

    def __init__(self, said: str) -> None:
        super().__init__(
            f"Redis does not let this user do that ({said}): let this process be the user that is "
            "meant for it, and Redis have the ACL file that `plateau redis-acl` of this Plateau "
            "writes"
        )


class WrongStore(FarmError):
    """The blob store is not the one that belongs to this Redis, or lacks what it must have."""


class Incompatible(FarmError):
    """This Plateau cannot work on the farm that it is to join; the message says what to do."""


class SchemaMismatch(Incompatible):
    """The data in Redis is of a layout that this Plateau cannot work with."""


def needs_other_layout(found: str) -> str:
    """How a message begins that is about data of another layout."""
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
    """Processes live that could not read the data any more if its layout was brought forward."""

    def __init__(self, found: str, who: tuple[str, ...]) -> None:
        super().__init__(
            f"{needs_other_layout(found)}. This one cannot migrate the data while these processes "
            f"work with it as it is: {', '.join(who)}. Stop them, then start this one again. "
            "Nothing was changed"
        )
        self.who = who


class Refused(Incompatible):
    """The farm speaks other versions of the protocol than this process.

    Attributes
    ----------
    too_old
        Whether it is the process that is too old; else it is too new.
    """

    def __init__(self, oldest: int, newest: int, plateau: str) -> None:
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


class CorruptBlob(FarmError):
    """A blob is not what its name says."""


class CorruptPartial(CorruptBlob):
    """A partial does not match what the ledger says of it."""
