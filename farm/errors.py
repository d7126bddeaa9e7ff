"""Everything that `farm` raises on purpose.

::

    FarmError
    ├── JobNotFound        no job of that id
    ├── IllegalTransition  the job's state does not allow this move; carries its story
    ├── FenceLost          another monitor owns the job now
    ├── StoreUnavailable   Redis or the blob store cannot be reached, or refuses
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


class FenceLost(FarmError):
    """This monitor no longer owns the job: its lease ran out and another took over."""

    def __init__(self, job_id: str) -> None:
        super().__init__(f"job {job_id} is owned by another monitor now")
        self.job_id = job_id


class StoreUnavailable(FarmError):
    """Redis or the blob store cannot be reached."""


class CorruptPartial(FarmError):
    """A partial does not match what the ledger says of it."""
