"""Starts the commands that jobs name for their ends, and says what came of them.

A command is a process of the monitor's: without a shell, the farm's credentials or a terminal, in
an empty folder of its own. It ends with the monitor, and another monitor then starts it again.
"""

import json
import logging
import os
import signal
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import IO, Final

from plateau.farm.ledger.outbox import Taken
from plateau.farm.process.allowed_commands import AllowedCommands, UnknownCommand
from plateau.farm.process.lifecycle import die_with_parent, plain_environment
from plateau.farm.process.scratch import scratch
from plateau.farm.wire.webhook_views import message

_LOG = logging.getLogger(__name__)

_LOOK_S: Final = 0.2
_MOST_WORDS: Final = 4096  #: bytes of its output that are kept, the last ones
_MOST_VALUE: Final = 4096  #: characters of a variable


class _NotRun(Exception):
    """The command was not started, or is not this monitor's any more; the message says why."""


@dataclass(frozen=True)
class Ran:
    """How a command ended."""

    exit_code: int | None  #: None where it did not end by itself
    words: str  #: the last line of its output, or why it was ended, or not started
    again: bool = False  #: whether another try may run it

    @property
    def error(self) -> str:
        """Why it did not succeed; "" where it did."""
        if self.exit_code == 0:
            return ""
        code = "" if self.exit_code is None else f"exit code {self.exit_code}"
        return ": ".join(filter(None, (code, self.words)))


@dataclass(frozen=True)
class Commands:
    """The allowed commands, and what they are told.

    Parameters
    ----------
    allowed
        What may be started.
    url
        Of the farm's page, as its users reach it.
    """

    allowed: AllowedCommands
    url: str | None = None

    def run(self, taken: Taken, why_not: Callable[[], str]) -> Ran:
        """Run the message's command to its end.

        `why_not` is asked several times a second whether it may continue, and says why not, or "".
        """
        try:
            return self._run(taken, why_not)
        except (_NotRun, UnknownCommand) as error:
            return Ran(None, f"for this monitor, {error}", again=True)
        except Exception as error:  # noqa: BLE001  (one command must not hurt the others)
            _LOG.exception("command %s could not be started", taken.command)
            kind = type(error).__name__
            return Ran(None, f"not started: {kind}; the monitor's log has more", again=True)

    def _run(self, taken: Taken, why_not: Callable[[], str]) -> Ran:
        words = self.allowed.named(taken.command or "")
        with scratch() as folder, _facts(taken) as facts:
            try:
                process = subprocess.Popen(
                    words,
                    stdin=facts,
                    stdout=subprocess.PIPE,
                    stderr=subprocess.STDOUT,
                    cwd=folder,
                    env={**plain_environment(), **self._variables(taken)},
                    preexec_fn=die_with_parent(signal.SIGKILL),
                    start_new_session=True,
                )
            except OSError as error:
                raise _NotRun(f"{words[0]} cannot be started: {error.strerror or error}") from error
            assert process.stdout is not None
            said = _Tail(process.stdout)
            try:
                return self._waited(process, said, why_not)
            finally:
                _end_group(process)

    def _waited(
        self,
        process: subprocess.Popen[bytes],
        said: "_Tail",
        why_not: Callable[[], str],
    ) -> Ran:
        ends = time.monotonic() + self.allowed.limit_s
        while True:
            try:
                code = process.wait(_LOOK_S)
            except subprocess.TimeoutExpired:
                if time.monotonic() > ends:
                    return Ran(None, f"it was ended after {self.allowed.limit_s:g} s")
                if words := why_not():
                    raise _NotRun(f"it was ended: {words}") from None
            else:
                # What it has left behind may keep its output open, and ends with it.
                _end_group(process)
                return Ran(code, said.last_line())

    def _variables(self, taken: Taken) -> dict[str, str]:
        job = taken.job
        facts = {
            "PLATEAU_JOB_ID": job.id,
            "PLATEAU_JOB_NAME": job.name,
            "PLATEAU_JOB_STATE": job.state.value,
            "PLATEAU_JOB_REASON": job.reason,
            "PLATEAU_JOB_SPP": str(job.spp),
            "PLATEAU_JOB_BATCH": job.spec.batch or "",
            "PLATEAU_BATCH_DONE": "" if taken.batch is None else "1",
            "PLATEAU_MESSAGE_ID": taken.id,
            "PLATEAU_TRY": str(taken.tries),
            **({} if self.url is None else {"PLATEAU_URL": self.url}),
        }
        return {name: text.replace("\0", "")[:_MOST_VALUE] for name, text in facts.items()}


@contextmanager
def _facts(taken: Taken) -> Iterator[IO[bytes]]:
    """A file with the message as JSON, as a webhook has it, and the batch's jobs by state."""
    told = message(taken.job, taken.event, taken.number, taken.at).model_dump(mode="json")
    with tempfile.TemporaryFile() as file:
        file.write(json.dumps({**told, "batch": taken.batch}).encode())
        file.seek(0)
        yield file


def _end_group(process: subprocess.Popen[bytes]) -> None:
    """End the process and all that it has started, unless it has left its group."""
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


class _Tail:
    """The end of an output, read by a thread so that its writer never waits."""

    def __init__(self, output: IO[bytes]) -> None:
        self._output = output
        self._last = b""
        self._thread = threading.Thread(target=self._read, name="output", daemon=True)
        self._thread.start()

    def _read(self) -> None:
        with self._output:
            while some := os.read(self._output.fileno(), 1 << 16):
                self._last = (self._last + some)[-_MOST_WORDS:]

    def last_line(self) -> str:
        """Its last line that is not empty."""
        self._thread.join(1.0)
        lines = self._last.decode(errors="replace").split("\n")
        return next((line.strip() for line in reversed(lines) if line.strip()), "")
