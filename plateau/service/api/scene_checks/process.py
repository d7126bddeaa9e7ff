"""The API's side of a process that checks scenes: it starts, asks and ends the process."""

import json
import signal
import threading
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, BinaryIO

from plateau.farm.bundle import BundleError, BundleLimits
from plateau.farm.process.child import Child, NoAnswer, write_part
from plateau.service.api.scene_checks import child as check_child

#: Values for a scene's `$parameters`, and the index of the sensor.
Asked = tuple[Mapping[str, str], int]


@dataclass(frozen=True)
class CheckBudget:
    """The limits on a check.

    The most expensive scene that was found within the limits of the bundle took 3.6 s and 130 MB.
    """

    cpu_s: float = 10.0  #: CPU time of a set of values; the kernel counts whole seconds
    total_s: float = 60.0  #: CPU time after which no further set of values is checked
    deadline_s: float = 30.0  #: wall time of one set of values, on a machine with other work
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
        self._child: Child | None = None

    def start(self) -> Child:
        """Start the process unless it runs."""
        with self._starting:
            if self._child is not None and not self._child.is_alive:
                self._child.end()
                self._child = None
            self._child = self._child or Child(check_child.__name__, self._budget.memory_bytes)
            return self._child

    def ask(
        self,
        file: BinaryIO,
        asked: Sequence[Asked],
        limits: BundleLimits,
        given_up: threading.Event,
    ) -> dict[str, Any]:
        """Have the process check the file with as many sets of values as the budget allows.

        To give the check up, set the event and then kill the process.

        Raises
        ------
        BundleError
            The check exceeds its budget, or crashes the process.
        CheckEnded
            Somebody killed the process.
        """
        child = self.start()
        if given_up.is_set():
            raise CheckEnded
        question = {
            "asked": [(dict(values), sensor) for values, sensor in asked],
            "limits": asdict(limits),
            "cpu_s": self._budget.cpu_s,
            "total_s": self._budget.total_s,
        }
        text = json.dumps(question).encode()
        deadline_s = self._budget.deadline_s + (len(asked) > 1) * self._budget.total_s
        try:
            told = child.ask(lambda to: write_part(to, text), deadline_s, file)
        except NoAnswer as error:
            child.end()
            raise self._ended(error) from error
        answer: dict[str, Any] = json.loads(told)
        if answer["is_last"]:
            child.end()
        if "out_of_memory" in answer:
            raise CheckTooDear(f"{self._budget.memory_bytes / 2**20:g} MiB of memory")
        return answer

    def kill(self) -> None:
        """Kill the process; the next `ask` starts another."""
        if self._child is not None:
            self._child.kill()

    def end(self) -> None:
        """Kill the process and clean up; only once no thread uses it."""
        if self._child is not None:
            self._child.end()

    def _ended(self, error: NoAnswer) -> Exception:
        """The error for a process that ended during a check."""
        status = error.status
        if status is None:  # at its deadline
            return CheckTooDear(f"{self._budget.deadline_s:g} s")
        if status == -signal.SIGXCPU:
            return CheckTooDear(f"{self._budget.cpu_s:g} s of CPU time")
        if status in (-signal.SIGKILL, -signal.SIGTERM):
            return CheckEnded()
        how = f"exit code {status}" if status >= 0 else signal.Signals(-status).name
        return BundleError(
            "not-a-scene", f"the scene cannot be checked: it ends the check with {how} ({error})"
        )
