"""Everything that `farm` raises on purpose.

::

    FarmError
    ├── JobNotFound        no job of that id
    ├── IllegalTransition  the job's state does not allow this move; carries its story
    ├── JobEnded           the job has ended and cannot be changed any more; carries its story
    ├── FenceLost          another monitor owns the job now
    ├── StoreUnavailable   Redis or the blob store cannot be reached, or refuses
    │   └── BlobsUnavailable   of the two, the blob store
    ├── WrongStore         the blob store is not the one that belongs to this Redis
    ├── SchemaMismatch     the data in Redis is of a layout that this Plateau cannot work with
    └── CorruptBlob        a blob is not what its name says
        └── CorruptPartial     a partial is not what its ledger entry says
"""


class FarmError(Exception):
    """Something in the contract between Plateau's processes did not hold."""


class JobNotFound(FarmError):
    """There is no job of this id."""

    def __init__(self, job_id: str) -> None:
        super().__init__(f"there is no job {job_id!r}")
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


class JobEnded(FarmError):
    """The job has ended: what it asks for cannot be changed any more."""

    def __init__(self, job_id: str, state: str, story: tuple[str, ...] = ()) -> None:
        super().__init__("\n  ".join([f"job {job_id} is {state}: it has ended", *story]))
        self.job_id = job_id
        self.state = state
        self.story = story


class FenceLost(FarmError):
    """This monitor no longer owns the job: its lease ran out and another took over."""

    def __init__(self, job_id: str) -> None:
        super().__init__(f"job {job_id} is owned by another monitor now")
        self.job_id = job_id


class StoreUnavailable(FarmError):
    """Redis or the blob store cannot be reached."""


class BlobsUnavailable(StoreUnavailable):
    """The blob store cannot be reached, is full, or refuses."""


class WrongStore(FarmError):
    """The blob store is not the one that belongs to this Redis."""


class SchemaMismatch(FarmError):
    """The data in Redis is of a layout that this Plateau cannot work with."""


class CorruptBlob(FarmError):
    """A blob is not what its name says."""


class CorruptPartial(CorruptBlob):
    """A partial does not match what the ledger says of it."""
