"""Slurm through its commands sbatch, squeue and scancel.

It uses options that Slurm has had for ten years, and no JSON output, whose format depends on the
version. Slurm itself stores which tasks are ours, by name, user and comment. So a restarted scaler
finds them again, and the next snapshot finds the tasks of an sbatch whose answer was lost.
"""

import getpass
import os
import re
import shutil
import subprocess
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from plateau.errors import CommandFailed, PlateauError
from plateau.scale.tasks import Task, TaskState

#: Longest wait for a command: a controller may be busy, or be taken over by its backup.
_PATIENCE_S: Final = 60.0

_WAITING: Final = frozenset(
    ("PENDING", "REQUEUED", "REQUEUE_FED", "REQUEUE_HOLD", "RESV_DEL_HOLD", "SPECIAL_EXIT")
)
_RUNNING: Final = frozenset(
    ("CONFIGURING", "RUNNING", "RESIZING", "SIGNALING", "STOPPED", "SUSPENDED")
)

#: Variables that a task does not inherit: the farm's secrets, which no worker needs, and those of
#: the Slurm job in which the scaler itself may run.
_KEPT_BACK: Final = re.compile(r"PLATEAU_KEY(_FILE)?|PLATEAU_WEBHOOK_SECRET|SLURM_(?!CONF$).*")


class SlurmFailed(PlateauError):
    """A command of Slurm failed; the message quotes it."""


def check_commands() -> None:
    """Raise `CommandFailed` unless Slurm's commands are on the PATH."""
    missing = [one for one in ("sbatch", "squeue", "scancel") if shutil.which(one) is None]
    if missing:
        raise CommandFailed(
            f"these commands of Slurm are not on the PATH: {', '.join(missing)}. Run this on a "
            "machine that can submit jobs to Slurm (a login node), and put its commands on the PATH"
        )


@dataclass(frozen=True, kw_only=True)
class Slurm:
    """Our tasks in Slurm; every method raises `SlurmFailed` if a command fails."""

    name: str  #: of the tasks; two scalers of one user need two names
    farm: str  #: the farm's id
    script: Path  #: the batch script
    options: Sequence[str]  #: of sbatch
    environment: Mapping[str, str]  #: the workers' variables besides those of this process

    @property
    def _comment(self) -> str:
        return f"plateau:{self.farm}"

    def tasks(self) -> tuple[Task, ...]:
        """Our tasks that have not ended, in the order of their submission."""
        rows = _run(
            "squeue",
            "--noheader",
            "--array",
            f"--name={self.name}",
            f"--user={getpass.getuser()}",
            "--format=%i|%T|%k|%r",
        )
        found = (row.split("|", 3) for row in rows.splitlines())
        ours = [(one, state, why) for one, state, comment, why in found if comment == self._comment]
        tasks = (Task(id=one, state=_state(state), why=why) for one, state, why in ours)
        return tuple(sorted(tasks, key=lambda task: [int(n) for n in re.findall(r"\d+", task.id)]))

    def submit(self, count: int) -> str:
        """Submit an array of this many tasks; returns its id."""
        environment = {
            name: value for name, value in os.environ.items() if not _KEPT_BACK.fullmatch(name)
        }
        answer = _run(*self.submission(count), environment={**environment, **self.environment})
        return answer.partition(";")[0]  # what follows names the cluster

    def submission(self, count: int) -> tuple[str, ...]:
        """The command line of `submit`."""
        return (
            "sbatch",
            *self.options,
            # Of two equal options, sbatch takes the last.
            "--parsable",
            "--export=ALL",
            f"--array=1-{count}",
            f"--job-name={self.name}",
            f"--comment={self._comment}",
            str(self.script),
        )

    def cancel_waiting(self, tasks: Iterable[str]) -> None:
        """Cancel those of these tasks that still wait for a machine."""
        _run("scancel", "--quiet", "--state=PENDING", *tasks)

    def end(self, tasks: Iterable[str]) -> None:
        """Ask these tasks' workers to leave, which takes them seconds."""
        _run("scancel", "--quiet", "--signal=TERM", "--batch", *tasks)


def label(task: str) -> str:
    """The label of the worker that Slurm has started as this task."""
    return f"slurm:{task}"


def _state(name: str) -> TaskState:
    if name in _WAITING:
        return TaskState.WAITS
    return TaskState.RUNS if name in _RUNNING else TaskState.LEAVES


def _run(*command: str, environment: Mapping[str, str] | None = None) -> str:
    """The output of a command."""
    try:
        done = subprocess.run(
            command,
            env=environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            encoding="utf-8",
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
