"""A real farm whose processes can be armed to be hit at an exact stage of their work."""

import json
import os
import signal
import subprocess
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import psutil

from tests.support.farms.real_farm import RealFarm
from tests.support.until import until

SIZE = 32
#: Converges at some 640 spp, after two or three seconds of a quiet worker.
SPEC: dict[str, Any] = {
    "parameters": {"width": SIZE, "height": SIZE},
    "step": 40,
    "slice_spp": 20,
    "max_spp": 1200,
    "rule": {"name": "reverse", "window": 5, "epsilon": 4.0},
}
#: The same by zones, which do all that frames do, and decide the plan besides.
BY_ZONES: dict[str, Any] = {**SPEC, "slice_spp": 10, "allocation": {"name": "zones", "size": 16}}
#: The same again, with half the points: enough for a fault in the middle, and for one at the end.
BRIEF: dict[str, Any] = {**BY_ZONES, "rule": {"name": "reverse", "window": 3, "epsilon": 8.0}}


class FaultyFarm(RealFarm):
    """`RealFarm`, with processes that meet a signal on their way."""

    kept: subprocess.Popen[bytes] | None = None  #: one that no test harms
    _kept_role = ""

    def keep(self, role: str) -> None:
        """Have one process of this role, and none besides, that serves test after test."""
        if self.kept is None or self.kept not in self.processes or self._kept_role != role:
            self.stop_all()
            self.kept, self._kept_role = self.start(role), role

    def start_armed(
        self,
        role: str,
        where: str,
        *arguments: str,
        when: str = "before",
        time: int = 1,
        signal_name: str = "SIGKILL",
        target: str = "self",
        constants: dict[str, object] | None = None,
        passed: tuple[int, ...] = (),
    ) -> subprocess.Popen[bytes]:
        """Start a process that a signal hits at a stage; see `tests.support.faults.stages`."""
        stage = {"where": where, "when": when, "time": time, "target": target}
        changes = {**stage, "signal": signal_name, "set": constants or {}}
        return self.start_changed(role, *arguments, passed=passed, **changes)

    def start_changed(
        self,
        role: str,
        *arguments: str,
        passed: tuple[int, ...] = (),
        environment: Mapping[str, str] = MappingProxyType({}),
        **changes: object,
    ) -> subprocess.Popen[bytes]:
        """Start a process with changes of `stages`, such as `set` or `clock_s`."""
        module, stage = "tests.support.faults.stages", json.dumps(changes)
        return self.start(
            role, *arguments, passed=passed, module=module, STAGE=stage, **environment
        )

    def start_patient(self, role: str, *arguments: str) -> subprocess.Popen[bytes]:
        """Start a process for which a slice may be tried a thousand times.

        Three faults at random may well meet on one slice, and its job would rightly fail.
        """
        return self.start_changed(
            role, *arguments, set={"plateau.farm.ledger.queue:MAX_TRIES": 1000}
        )

    def wait_until_ended(
        self, process: subprocess.Popen[bytes], by: signal.Signals | None = None
    ) -> None:
        """Wait until the process has ended by the signal, or in order; then it is forgotten."""
        until(lambda: process.poll() is not None)
        assert process.returncode == (-by if by else 0)
        self.processes.remove(process)

    def wait_until_stopped(self, process: subprocess.Popen[bytes]) -> None:
        """Wait until SIGSTOP has hit the process."""
        until(lambda: psutil.Process(process.pid).status() == psutil.STATUS_STOPPED)

    def resume(self, process: subprocess.Popen[bytes]) -> None:
        os.kill(process.pid, signal.SIGCONT)

    def wait_for_workers(self, count: int) -> None:
        until(lambda: len(self.client.workers()) == count)
