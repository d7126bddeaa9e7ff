"""One process of the tree: starts, watches, restarts and stops it."""

import os
import signal
import subprocess
import sys
import time
from dataclasses import KW_ONLY, dataclass, field
from pathlib import Path
from typing import Final

from plateau.farm.process.lifecycle import die_with_parent, how_ended
from plateau.farm.process.log import rotate
from plateau.farm.process.waits import Backoff

_BACKOFF_S: Final = 0.5
_LONGEST_BACKOFF_S: Final = 30.0
#: A process that lived this long has started well.
_WELL_S: Final = 30.0
_LAST_WORDS_BYTES: Final = 2000
#: Variables that no process of the farm inherits, since none uses the API as a client.
_KEYS: Final = ("PLATEAU_KEY", "PLATEAU_KEY_FILE", "PLATEAU_WEBHOOK_SECRET")


@dataclass(eq=False)
class Member:
    """A ``python -m plateau …`` in a session of its own, with a log file."""

    name: str  #: in messages, and of its log
    arguments: tuple[str, ...]  #: the command and its options
    _: KW_ONLY
    environment: dict[str, str]  #: variables besides those of this process
    logs: Path  #: the folder of its log
    inherited: tuple[int, ...]  #: file descriptors that it keeps open
    deaths: int = field(default=0, init=False)  #: in a row, each soon after its start

    def __post_init__(self) -> None:
        self.log = self.logs / f"{self.name}.log"
        self._process: subprocess.Popen[bytes] | None = None
        self._asked_to_stop = False
        self._started_at = 0.0
        self._begins_at = 0  # where the output of its last start begins in its log
        self._start_after = 0.0
        self._backoff = Backoff(_BACKOFF_S, _LONGEST_BACKOFF_S)

    def start(self, *, passed: tuple[int, ...] = (), more: tuple[str, ...] = ()) -> None:
        """Start it, this time also with these descriptors and arguments."""
        self.rotate_log()
        inherited = {name: value for name, value in os.environ.items() if name not in _KEYS}
        with self.log.open("ab") as log:
            self._begins_at = log.tell()
            # With a session of its own, a Ctrl-C in the terminal reaches only the tree's root.
            self._process = subprocess.Popen(
                [sys.executable, "-m", "plateau", *self.arguments, *more],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                env={**inherited, **self.environment},
                start_new_session=True,
                pass_fds=(*self.inherited, *passed),
                preexec_fn=die_with_parent(),
            )
        self._asked_to_stop = False
        self._started_at = time.monotonic()

    def rotate_log(self) -> None:
        """Rotate its log if that is too long, whether the process runs or not."""
        if rotate(self.log):
            self._begins_at = 0

    def has_died(self) -> str | None:
        """How the process ended, once for each death; None otherwise."""
        if self._process is None or self._process.poll() is None:
            return None
        status, self._process = self._process.returncode, None
        lived_s = time.monotonic() - self._started_at
        if lived_s > _WELL_S:
            self.deaths = 0
            self._backoff.reset()
        self.deaths += 1
        self._start_after = time.monotonic() + self._backoff.delay_s()
        return f"{self.name} {how_ended(status)}"

    def start_if_due(self) -> None:
        """Restart it if it has died and its pause is over."""
        if self._process is None and time.monotonic() >= self._start_after:
            self._start_after = time.monotonic() + _LONGEST_BACKOFF_S  # should it be impossible
            self.start()

    def ask_to_stop(self) -> None:
        """Send SIGTERM once: a second one would end a process that is stopping."""
        if self._process is not None and not self._asked_to_stop:
            self._process.terminate()
            self._asked_to_stop = True

    def is_running(self) -> bool:
        """Whether the process runs."""
        return self._process is not None and self._process.poll() is None

    def kill(self) -> None:
        """End it by force, with all processes of its session."""
        if self._process is not None and self._process.poll() is None:
            os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()

    def last_words(self) -> str:
        """The end of its log since its last start."""
        if not self.log.exists():
            return ""
        with self.log.open("rb") as log:
            log.seek(max(self._begins_at, self.log.stat().st_size - _LAST_WORDS_BYTES))
            lines = log.read().decode(errors="replace").splitlines()
        return "\n".join(f"  {line}" for line in lines[-15:]) or "  (it said nothing)"
