"""The API's side of a process that checks scenes: it starts, asks and ends the process."""

import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, BinaryIO

from plateau.farm.bundle import BundleError, BundleLimits
from plateau.farm.process.lifecycle import plain_environment
from plateau.service.api.scene_checks import child as check_child

#: Values for a scene's `$parameters`, and the index of the sensor.
Asked = tuple[Mapping[str, str], int]


@dataclass(frozen=True)
class CheckBudget:
    """The limits on a check.

    The most expensive scene that was found within the limits of `plateau.farm.bundle` took 3.6 s
    and 130 MB.
    """

    cpu_s: float = 10.0  #: CPU time of one turn; the kernel counts whole seconds
    turn_s: float = 1.0  #: CPU time after which a turn starts with no further set of values
    deadline_s: float = 30.0  #: wall time of one turn, on a machine with other work
    memory_bytes: int = 256 * 2**20  #: memory that the process writes to


class CheckTooDear(BundleError):
    """A check exceeded its budget."""

    def __init__(self, what: str) -> None:
        super().__init__(
            "xml-too-large",
            f"the scene takes more than {what} to check; put geometry into mesh files, and use "
            "fewer includes and parameters",
        )


class CheckEnded(Exception):
    """Somebody killed the process during a check; that says nothing about the scene."""


class CheckProcess:
    """One process, started at the first question and again whenever it has ended.

    `start` and `ask` are for one thread at a time, `kill` is for any.
    """

    def __init__(self, budget: CheckBudget) -> None:
        self._budget = budget
        self._starting = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._link: socket.socket | None = None
        self._is_killed = False

    def start(self) -> socket.socket:
        """Start the process unless it runs; returns the socket to it."""
        with self._starting:
            if self._process is not None and (self._is_killed or self._process.poll() is not None):
                self._bury()
            if self._link is None:
                self._link = self._launched()
            return self._link

    def ask(
        self,
        file: BinaryIO,
        asked: Sequence[Asked],
        limits: BundleLimits,
        given_up: threading.Event,
    ) -> dict[str, Any]:
        """Have the process check the file with as many sets of values as a turn allows.

        To give the check up, set the event and then kill the process.

        Raises
        ------
        BundleError
            The check exceeds its budget, or crashes the process.
        CheckEnded
            Somebody killed the process.
        """
        link = self.start()
        if given_up.is_set():
            raise CheckEnded
        link.settimeout(self._budget.deadline_s)
        question = {
            "asked": [(dict(values), sensor) for values, sensor in asked],
            "limits": asdict(limits),
            "cpu_s": self._budget.cpu_s,
            "turn_s": self._budget.turn_s,
        }
        try:
            check_child.send(link, question, file.fileno())
            answer = check_child.received(link)
        except TimeoutError as error:
            self.kill()
            raise CheckTooDear(f"{self._budget.deadline_s:g} s") from error
        except (EOFError, OSError) as error:
            raise self._died() from error
        if answer["is_last"]:
            self._bury()
        if "out_of_memory" in answer:
            raise CheckTooDear(f"{self._budget.memory_bytes / 2**20:g} MiB of memory")
        return answer

    def kill(self) -> None:
        """Kill the process; the next `ask` starts another."""
        self._is_killed = True
        if self._process is not None:
            self._process.kill()

    def end(self) -> None:
        """Kill the process and clean up; only once no thread uses it."""
        self.kill()
        if self._process is not None:
            self._bury()

    def _launched(self) -> socket.socket:
        self._is_killed = False
        ours, its = socket.socketpair()
        with its:
            # The process ends when our end is closed, also by the end of this process.
            self._process = subprocess.Popen(
                [
                    *(sys.executable, "-m", check_child.__name__),
                    *(str(its.fileno()), str(self._budget.memory_bytes)),
                ],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                env=plain_environment(),
                pass_fds=(its.fileno(),),
                start_new_session=True,
            )
        return ours

    def _died(self) -> Exception:
        """The error for a process that ended during a check."""
        status = self._bury()
        if status == -signal.SIGXCPU:
            return CheckTooDear(f"{self._budget.cpu_s:g} s of CPU time")
        if status in (-signal.SIGKILL, -signal.SIGTERM):
            return CheckEnded()
        how = f"exit code {status}" if status >= 0 else signal.Signals(-status).name
        return BundleError(
            "not-a-scene", f"the scene cannot be checked: it ends the check with {how}"
        )

    def _bury(self) -> int:
        """Clean up after a process that has ended or is about to; returns its exit status."""
        assert self._process is not None
        assert self._link is not None
        self._link.close()
        status = self._process.wait()
        self._process = self._link = None
        return status
