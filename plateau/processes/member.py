"""One process of the tree: started, watched, started again, stopped."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from plateau.farm.process.lifecycle import die_with_parent
from plateau.farm.process.log import rotate

_BACKOFF_S: Final = 0.5
_LONGEST_BACKOFF_S: Final = 30.0
#: A process that lived for so long had started well.
_WELL_S: Final = 30.0
_LAST_WORDS_BYTES: Final = 2000
_KEYS: Final = ("PLATEAU_KEY", "PLATEAU_KEY_FILE", "PLATEAU_WEBHOOK_SECRET")


class Member:
    """A ``python -m plateau …`` in a session of its own, with a log file.

    Parameters
    ----------
    name
        What it is called, in messages and as its log.
    arguments
        Its command and options.
    environment
        Variables beside those of this process.
    logs
        Folder of its log.
    inherited
        File descriptors that it holds as long as it lives.
    """

    def __init__(
        self,
        name: str,
        arguments: tuple[str, ...],
        *,
        environment: dict[str, str],
        logs: Path,
        inherited: tuple[int, ...] = (),
    ) -> None:
        self.name = name
        self.arguments = arguments
        self.log = logs / f"{name}.log"
        self.deaths = 0  #: in a row, each soon after its start
        self._environment = environment
        self._inherited = inherited
        self._process: subprocess.Popen[bytes] | None = None
        self._asked_to_stop = False
        self._started_at = 0.0
        self._begins_at = 0  # in its log, what this start of it says
        self._start_after = 0.0

    @property
    def pid(self) -> int | None:
        """Its process id; None where it never ran."""
        return self._process.pid if self._process else None

    def start(self, *, passed: tuple[int, ...] = (), more: tuple[str, ...] = ()) -> None:
        """Start it, for once with these descriptors and arguments too."""
        self.rotate_log()
        with self.log.open("ab") as log:
            self._begins_at = log.tell()
            # A session of its own: a Ctrl-C in the terminal reaches the tree's root alone.
            self._process = subprocess.Popen(
                [sys.executable, "-m", "plateau", *self.arguments, *more],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                env={**_without_key(os.environ), **self._environment},
                start_new_session=True,
                pass_fds=(*self._inherited, *passed),
                preexec_fn=die_with_parent(),
            )
        self._asked_to_stop = False
        self._started_at = time.monotonic()

    def rotate_log(self) -> None:
        """Begin its log anew where that is too long, whether it runs or not."""
        if rotate(self.log):
            self._begins_at = 0

    def has_died(self) -> str | None:
        """How the process ended, once for each time that it did; None while it runs."""
        if self._process is None or self._process.poll() is None:
            return None
        status, self._process = self._process.returncode, None
        lived_s = time.monotonic() - self._started_at
        self.deaths = 1 if lived_s > _WELL_S else self.deaths + 1
        backoff_s = min(_BACKOFF_S * 2 ** (self.deaths - 1), _LONGEST_BACKOFF_S)
        self._start_after = time.monotonic() + backoff_s
        return f"{self.name} {describe_exit(status)}"

    def start_if_due(self) -> None:
        """Start it again where it died and has waited long enough."""
        if self._process is None and time.monotonic() >= self._start_after:
            self.start()

    def ask_to_stop(self) -> None:
        """Send SIGTERM, once: it may be on its way out, where a second one would end it."""
        if self._process is not None and not self._asked_to_stop:
            self._process.terminate()
            self._asked_to_stop = True

    def is_running(self) -> bool:
        """Whether it runs."""
        return self._process is not None and self._process.poll() is None

    def kill(self) -> None:
        """End it by force, with all that it started in its session."""
        if self._process is not None and self._process.poll() is None:
            os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()

    def last_words(self) -> str:
        """The end of its log, of what it said since it was started last."""
        if not self.log.exists():
            return ""
        with self.log.open("rb") as log:
            log.seek(max(self._begins_at, self.log.stat().st_size - _LAST_WORDS_BYTES))
            lines = log.read().decode(errors="replace").splitlines()
        return "\n".join(f"  {line}" for line in lines[-15:]) or "  (it said nothing)"


def _without_key(environment: Mapping[str, str]) -> dict[str, str]:
    """What a process of the farm inherits: it shows nobody an API key, so it gets none."""
    return {name: value for name, value in environment.items() if name not in _KEYS}


def describe_exit(status: int) -> str:
    """A process's exit status in words."""
    if status >= 0:
        return f"ended with exit code {status}"
    return f"was ended by {signal.Signals(-status).name}"
