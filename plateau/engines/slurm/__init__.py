"""Workers by Slurm, through its commands sbatch, squeue, scontrol and scancel.

It uses options that Slurm has had for ten years, and no JSON output, whose format depends on the
version. Slurm itself knows which tasks are the run's, by their name.
"""

import os
import re
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from contextlib import suppress
from importlib.resources import files
from pathlib import Path
from typing import Final

from plateau.engines.contract import Crew, Task, TaskState, refuse_several_gpus
from plateau.errors import CommandFailed

#: Longest wait for a command: a controller may be busy, or be taken over by its backup.
_PATIENCE_S: Final = 60.0

_STATES: Final = {
    "CANCELLED": TaskState.CANCELLED,
    **dict.fromkeys(("PENDING", "REQUEUED", "REQUEUE_FED"), TaskState.WAITS),
    **dict.fromkeys(("REQUEUE_HOLD", "RESV_DEL_HOLD", "SPECIAL_EXIT"), TaskState.WAITS),
    **dict.fromkeys(("COMPLETED", "TIMEOUT", "DEADLINE", "NODE_FAIL"), TaskState.LEFT),
    **dict.fromkeys(("PREEMPTED", "BOOT_FAIL", "REVOKED"), TaskState.LEFT),
}
_FAILED: Final = frozenset(("FAILED", "OUT_OF_MEMORY"))

#: Variables that nodes have from the crew, and those of the job in which the command may run.
_NOT_PASSED: Final = re.compile(r"PLATEAU_.*|SLURM_(?!CONF$).*|SBATCH_CLUSTERS|SQUEUE_.*")
_CLUSTERS: Final = re.compile(r"-M.*|--clusters?(=.*)?")
_SEVERAL_GPUS: Final = re.compile(
    r"(?<!\S)--(gpus(-per-\w+)?[= ](\S+:)?|gres[= ](\S*,)?gpu:([^\s:,]+:)?)([2-9]|1\d)\d*(?![^\s,])"
)
_LAST_WORDS: Final = 400  #: characters


class Slurm:
    """The workers of one run; `plateau.engines.contract.Engine` explains the methods.

    A task writes its log into the folder of the command, if it is there on the node, and the
    command removes it. ``--output=…`` among the options names another file.
    """

    def __init__(self, options: Sequence[str], crew: Crew) -> None:
        if several := _SEVERAL_GPUS.search(" ".join(options)):
            refuse_several_gpus(several[0].strip())
        if any(map(_CLUSTERS.fullmatch, options)):
            raise CommandFailed(
                "Plateau asks Slurm's own cluster alone: leave out -M and --clusters, and run this "
                "on a login node of the other one"
            )
        missing = [
            one for one in ("sbatch", "squeue", "scontrol", "scancel") if shutil.which(one) is None
        ]
        if missing:
            raise CommandFailed(
                f"these commands of Slurm are not on the PATH: {', '.join(missing)}. Run this on a "
                "machine that can submit jobs to Slurm (a login node), and put its commands on the "
                "PATH"
            )
        self._crew, self._options = crew, tuple(options)
        self._logs = Path.cwd()
        self._keeper: subprocess.Popen[bytes] | None = None
        self._ended: dict[str, Task] = {}

    def ask(self, count: int) -> None:
        """Submit an array of this many tasks."""
        if self._keeper is None:
            self._keeper = self._keep()
        may_write = os.access(self._logs, os.W_OK)
        output = self._logs / self._log("%A_%a") if may_write else "/dev/null"
        threads = self._crew.threads
        _run(
            "sbatch",
            f"--output={output}",
            *([] if threads is None else [f"--cpus-per-task={threads}"]),
            *self._options,
            # Of two equal options, sbatch takes the last.
            "--parsable",
            "--export=ALL",
            f"--array=1-{count}",
            f"--job-name={self._crew.name}",
            str(files(__name__) / "worker.sbatch"),
            environment={**self._crew.environment, "PLATEAU_PYTHON": self._crew.python},
        )

    def tasks(self) -> Sequence[Task]:
        """The tasks that Slurm remembers; it forgets those that ended after some minutes."""
        options = ("--noheader", "--array", "--states=all", "--format=%i|%T|%N|%r")
        rows = _run("squeue", *options, *self._own())
        tasks = [self._task(*row.split("|", 3)) for row in rows.splitlines()]
        return sorted(tasks, key=lambda task: [int(n) for n in re.findall(r"\d+", task.id)])

    def release(self) -> None:
        """Cancel all tasks of this name, and remove their logs."""
        if self._keeper is not None:
            with suppress(subprocess.TimeoutExpired):  # the nodes notice by themselves, later
                self._keeper.communicate(b"\n", timeout=_PATIENCE_S)  # a fork may hold the pipe
            self._keeper = None
            for log in self._logs.glob(self._log("*")):
                with suppress(OSError):
                    log.unlink()

    def _keep(self) -> "subprocess.Popen[bytes]":
        """A process that cancels the tasks once this one closes its pipe, or is killed."""
        return subprocess.Popen(
            ["sh", "-c", 'read _; exec scancel --quiet "$@"', "sh", *self._own()],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
            env=_kept(),
        )

    def _task(self, task: str, name: str, node: str, reason: str) -> Task:
        if name in _FAILED:
            if task not in self._ended:
                self._ended[task] = self._failed(task, node)
            return self._ended[task]
        state = _STATES.get(name, TaskState.RUNS)  # or it ends, and has its node
        waits = state is TaskState.WAITS and reason != "None"
        return Task(id=task, state=state, node=node, why=reason if waits else "")

    def _failed(self, task: str, node: str) -> Task:
        told = re.search(r" ExitCode=(\d+):", _run("scontrol", "--oneliner", "show", "job", task))
        code, words = int(told[1]) if told else None, ""
        with suppress(OSError):  # the node does not see this folder
            words = (self._logs / self._log(task)).read_text("utf-8", "replace")
        why = " ".join(words[-_LAST_WORDS:].split())
        return Task(id=task, state=TaskState.FAILED, node=node, code=code, why=why)

    def _own(self) -> tuple[str, ...]:
        """Options that mean the tasks of this run."""
        return f"--name={self._crew.name}", f"--user={os.getuid()}"

    def _log(self, task: str) -> str:
        return f"{self._crew.name}-{task}.log"


def _kept() -> dict[str, str]:
    """The variables of this process that may mean Slurm's commands."""
    return {n: value for n, value in os.environ.items() if not _NOT_PASSED.fullmatch(n)}


def _run(*command: str, environment: Mapping[str, str] | None = None) -> str:
    """The output of a command."""
    try:
        done = subprocess.run(
            command,
            env={**_kept(), **(environment or {})},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            encoding="utf-8",
            errors="replace",
            timeout=_PATIENCE_S,
            check=False,
            start_new_session=True,  # a Ctrl-C in the terminal is not meant for it
        )
    except subprocess.TimeoutExpired as error:
        raise CommandFailed(
            f"Slurm's {command[0]} did not answer within {_PATIENCE_S:g} s; `scontrol ping` says "
            "whether its controller runs"
        ) from error
    if done.returncode:
        lines = [line.removeprefix(f"{command[0]}: error: ") for line in done.stderr.splitlines()]
        words = "; ".join(filter(None, map(str.strip, lines))) or f"exit code {done.returncode}"
        raise CommandFailed(f"Slurm's {command[0]} failed: {words}")
    return done.stdout.strip()
