"""What a test run leaves of its network when it is killed is gone when the next one begins."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import psutil

from tests.cluster.support_network import Network

_IS_KILLED = """
import os, signal, subprocess, sys
from pathlib import Path
from tests.cluster.support_network import Network

network = Network(Path, "a", "b").__enter__()
left = subprocess.Popen([*network.on("a"), "sleep", "600"])
print(left.pid, " ".join(network.on("a")), flush=True)
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_what_a_killed_run_left_is_removed(tool: Callable[[str], Path]) -> None:
    path = f"{os.environ['PATH']}:/usr/sbin:/sbin"
    command = (sys.executable, "-c", _IS_KILLED)
    killed = subprocess.Popen(command, stdout=subprocess.PIPE, env={**os.environ, "PATH": path})
    assert killed.stdout is not None
    with killed.stdout as said:
        pid, *_, space = said.readline().decode().split()
    assert killed.wait(60) == -signal.SIGKILL
    folder = Path(space.removeprefix("--net="))
    assert folder.exists()
    assert psutil.pid_exists(int(pid))
    # When another run begins, beside one that goes on
    with Network(tool, "a") as one, Network(tool, "a") as other:
        assert not folder.exists()
        left = [process for process in psutil.process_iter() if process.pid == int(pid)]
        assert all(process.status() == psutil.STATUS_ZOMBIE for process in left)
        for network in (one, other):
            subprocess.run((*network.on("a"), "true"), check=True)
