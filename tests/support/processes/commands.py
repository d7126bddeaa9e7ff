"""Plateau's commands as real processes, and all that they start."""

import hashlib
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import psutil
from typer.testing import CliRunner

from plateau.commands import app
from tests.support.until import until


def plateau(*arguments: object, **environment: str) -> tuple[int, str, str]:
    """Exit code, standard output and standard error of a command, run in this process."""
    done = CliRunner().invoke(app, [str(one) for one in arguments], env=environment)
    assert done.exception is None or isinstance(done.exception, SystemExit), done.exception
    return done.exit_code, done.stdout, done.stderr


class Command:
    """A ``plateau`` command under way; as a context manager, it has ended when that is left.

    Parameters
    ----------
    arguments
        The command line after ``plateau``.
    folder
        Where its data and what it says are kept.
    program
        What Python runs.
    python
        The interpreter.
    prepare
        What its process does before it becomes the command.
    """

    def __init__(
        self,
        *arguments: str,
        folder: Path,
        program: tuple[str, ...] = ("-m", "plateau"),
        python: str = sys.executable,
        prepare: Callable[[], object] | None = None,
        **environment: str,
    ) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        # One for each folder, and short, since a socket's path may have 100 bytes.
        digest = hashlib.sha256(os.fsencode(folder)).hexdigest()
        self.temporary = Path(os.environ["TESTS_TEMPORARY"], digest[:12])
        self.temporary.mkdir(exist_ok=True)
        self._said = folder / f"said-{time.monotonic_ns()}"
        with self._said.open("wb") as said:
            self.process = subprocess.Popen(
                [python, *program, *arguments],
                stdin=subprocess.DEVNULL,
                stdout=said,
                stderr=said,
                preexec_fn=prepare,
                env={
                    "PATH": os.environ["PATH"],
                    "PLATEAU_DATA": str(folder / "data"),
                    "PLATEAU_CACHE": os.environ["TESTS_CACHE"],
                    "TMPDIR": str(self.temporary),
                    **environment,
                },
            )
        self._seen: dict[int, psutil.Process] = {}

    def __enter__(self) -> "Command":
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    @property
    def said(self) -> str:
        """What it has printed, both streams."""
        return self._said.read_text()

    def wait_for(self, pattern: str, seconds: float = 120) -> str:
        """What it printed first that matches: the pattern's group, or all of it."""
        found: list[str] = []

        def has_said() -> bool:
            match = re.search(pattern, self.said)
            found.extend([match.group(match.lastindex or 0)] if match else [])
            if not found:
                assert self.process.poll() is None, f"it ended: {self.said}"
            return bool(found)

        until(has_said, seconds, lambda: f"it never said {pattern!r}: {self.said}")
        return found[0]

    def family(self) -> list[psutil.Process]:
        """Every process that it has started, directly or not, and that still runs."""
        if self.process.poll() is None:
            for one in psutil.Process(self.process.pid).children(recursive=True):
                self._seen[one.pid] = one
        return [one for one in self._seen.values() if _runs(one)]

    def member(self, name: str) -> psutil.Process:
        """The process that runs ``plateau NAME``, once there is one."""
        return until(lambda: next((one for one in self.family() if _is(name, one)), None), 60)

    def exit_code(self, seconds: float = 120) -> int:
        """Its exit code, once it has ended."""
        try:
            return self.process.wait(seconds)
        except subprocess.TimeoutExpired:
            raise AssertionError(f"it did not end: {self.said}") from None

    def is_gone(self, seconds: float = 60) -> None:
        """Assert that nothing of it runs any more, soon."""
        until(lambda: not self.family(), seconds, lambda: f"still running: {self.family()}")

    def end(self) -> None:
        """End all of it by force."""
        for one in self.family():
            with suppress(psutil.NoSuchProcess):  # a child goes with its parent
                one.kill()
        self.process.kill()
        self.process.wait()


def starting(start: Callable[..., Any]) -> Iterator[Callable[..., Any]]:
    """What starts commands, or enters what else ends; none outlives who yields from this."""
    with ExitStack() as stack:
        yield lambda *given, **more: stack.enter_context(start(*given, **more))


def _is(name: str, process: psutil.Process) -> bool:
    try:
        return name in process.cmdline()[2:4]
    except psutil.NoSuchProcess:
        return False


def _runs(process: psutil.Process) -> bool:
    try:
        return process.is_running() and process.status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False
