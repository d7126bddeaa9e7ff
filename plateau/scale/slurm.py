"""Slurm by its commands: sbatch, squeue and scancel, which every installation has.

Their options are those that Slurm has had for ten years; nothing is read from JSON, whose shape
differs with the version. What is ours is known by name, user and comment, in Slurm itself, so a
restart finds it again, and an sbatch whose answer was lost is found at the next look.
"""

import getpass
import os
import re
import shutil
import subprocess
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from plateau.errors import CommandFailed, PlateauError
from plateau.scale.tasks import Task, TaskState

#: Until a command is given up; one waits for a controller that is busy, or is taken over.
_PATIENCE_S: Final = 60.0

_WAITING: Final = frozenset(
    ("PENDING", "REQUEUED", "REQUEUE_FED", "REQUEUE_HOLD", "RESV_DEL_HOLD", "SPECIAL_EXIT")
)
_RUNNING: Final = frozenset(
    ("CONFIGURING", "RUNNING", "RESIZING", "SIGNALING", "STOPPED", "SUSPENDED")
)

#: What a task does not inherit from who submits it: the farm's API keys, which no worker needs, and
#: the surroundings of a Slurm job in which the scaler itself may run.
_KEPT_BACK: Final = re.compile(r"PLATEAU_KEY(_FILE)?|PLATEAU_WEBHOOK_SECRET|SLURM_(?!CONF$).*")


class SlurmFailed(PlateauError):
    """A command of Slurm's failed; the message has its words."""


def check_commands() -> None:
    """Return where Slurm's commands are; raise `CommandFailed` where one is missing."""
    missing = [one for one in ("sbatch", "squeue", "scancel") if shutil.which(one) is None]
    if missing:
        raise CommandFailed(
            f"these commands of Slurm are not on the PATH: {', '.join(missing)}. Run this where "
            "jobs are submitted to Slurm (a login node), and put its commands on the PATH"
        )


@dataclass(frozen=True, kw_only=True)
class Request:
    """What each worker is to have."""

    script: Path  #: the batch script
    options: tuple[str, ...]  #: of sbatch
    environment: Mapping[str, str]  #: for the workers, beside the variables of this process


class Slurm:
    """Our tasks in Slurm.

    Parameters
    ----------
    name
        The tasks' name: two scalers of one user need two.
    farm
        Id of the farm that the workers are for; it is in the tasks' comment.
    request
        What each is to have.

    Methods raise `SlurmFailed` where a command does not do what it was told to.
    """

    def __init__(self, name: str, farm: str, request: Request) -> None:
        self._name = name
        self._comment = f"plateau:{farm}"
        self._request = request

    def tasks(self) -> tuple[Task, ...]:
        """Our tasks that have not ended, as they were submitted."""
        rows = _run(
            "squeue",
            "--noheader",
            "--array",
            f"--name={self._name}",
            f"--user={getpass.getuser()}",
            "--format=%i|%T|%k|%r",
        )
        found = (row.split("|", 3) for row in rows.splitlines())
        ours = [(one, state, why) for one, state, comment, why in found if comment == self._comment]
        tasks = (Task(id=one, state=_state(state), why=why) for one, state, why in ours)
        return tuple(sorted(tasks, key=lambda task: [int(n) for n in re.findall(r"\d+", task.id)]))

    def submit(self, count: int) -> str:
        """Submit an array of so many tasks; returns its id."""
        environment = {
            name: value for name, value in os.environ.items() if not _KEPT_BACK.fullmatch(name)
        }
        answer = _run(
            *self.submission(count), environment={**environment, **self._request.environment}
        )
        return answer.partition(";")[0]  # what follows names the cluster

    def submission(self, count: int) -> tuple[str, ...]:
        """The command with which `submit` does so."""
        return (
            "sbatch",
            *self._request.options,
            # These come last, and so count.
            "--parsable",
            "--export=ALL",
            f"--array=1-{count}",
            f"--job-name={self._name}",
            f"--comment={self._comment}",
            str(self._request.script),
        )

    def cancel_waiting(self, tasks: Iterable[str]) -> None:
        """Cancel those of these tasks that still wait; one that has begun meanwhile goes on."""
        _run("scancel", "--quiet", "--state=PENDING", *tasks)

    def end(self, tasks: Iterable[str]) -> None:
        """Ask these tasks' workers to leave, which they do within seconds."""
        _run("scancel", "--quiet", "--signal=TERM", "--batch", *tasks)


def label(task: str) -> str:
    """The label of the worker that a task brings, as worker.sbatch gives it."""
    return f"slurm:{task}"


def _state(name: str) -> TaskState:
    if name in _WAITING:
        return TaskState.WAITS
    return TaskState.RUNS if name in _RUNNING else TaskState.LEAVES


def _run(*command: str, environment: Mapping[str, str] | None = None) -> str:
    """What a command prints."""
    try:
        done = subprocess.run(
            command,
            env=environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=_PATIENCE_S,
            check=False,
        )
    except subprocess.TimeoutExpired as error:
        raise SlurmFailed(
            f"Slurm's {command[0]} did not answer within {_PATIENCE_S:g} s; `scontrol ping` says "
            "whether its controller runs"
        ) from error
    if done.returncode:
        words = " ".join(done.stderr.split()) or f"exit code {done.returncode}"
        raise SlurmFailed(f"Slurm's {command[0]} failed: {words}")
    return done.stdout.strip()
