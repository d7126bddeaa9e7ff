"""What an engine is: it asks a batch system for workers, says how they are, and ends them all."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Final, NoReturn, Protocol

from plateau.errors import CommandFailed

#: The entry point group of engines: a callable that fits `Engine.__init__`, by the engine's name.
GROUP: Final = "plateau.engines"


class TaskState(Enum):
    """The state of a task; the last three are ends."""

    WAITS = "waits"  #: for a machine
    RUNS = "runs"
    LEFT = "left"  #: it ended well, or its machine was taken from it: another may take its place
    CANCELLED = "cancelled"  #: by somebody: none is to take its place
    FAILED = "failed"


@dataclass(frozen=True, kw_only=True)
class Task:
    """What the batch system calls a job or an actor: one worker. A job is an image to render."""

    id: str
    state: TaskState
    node: str = ""  #: where it runs or ran
    why: str = ""  #: the batch system's reason why it waits, or the last words of one that failed
    code: int | None = None  #: the exit code of one that failed; `plateau.engines.node` has them


@dataclass(frozen=True, kw_only=True)
class Crew:
    """What the workers of one run are to be."""

    name: str  #: of this run, unlike all others: lower-case letters, digits and hyphens
    python: str  #: the interpreter that has Plateau on the nodes
    environment: Mapping[str, str]  #: every PLATEAU_… variable of a worker, secrets included
    threads: int | None  #: cores of each worker; None for what the engine gives


def refuse_several_gpus(option: str) -> NoReturn:
    """Say what to ask for in place of an option that gives a worker several GPUs."""
    instead = f"in place of {option} ask for one, and for more --workers"
    raise CommandFailed(f"a worker renders on one GPU: {instead}")


class Engine(Protocol):
    """Workers of one run in a batch system."""

    def __init__(self, options: Sequence[str], crew: Crew) -> None:
        """Check what can be checked at once; `PlateauError` where the batch system is not here.

        `options` follow the engine's name in ``--on``, in the batch system's own words.
        """

    def ask(self, count: int) -> None:
        """Ask for this many workers more; `PlateauError` where that is refused."""

    def tasks(self) -> Sequence[Task]:
        """All tasks that were ever asked for, in a fixed order; one that ended may be left out.

        `PlateauError` while the batch system does not answer.
        """

    def release(self) -> None:
        """End all tasks, also those of an `ask` whose answer was lost; it may be called again."""
