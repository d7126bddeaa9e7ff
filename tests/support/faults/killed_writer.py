"""Writes a job's results into a folder of another, killed before changes that it makes there.

A process of its own, since it forks: ``python -m tests.support.faults.killed_writer URL ID FOLDER
STRIDE``, killed before each STRIDE-th change. FOLDER has ``before``, the results of another job;
they are copied to ``there``. Each line that is printed says, as JSON, what that has after one of
the kills, and what it has when the job's results are then written once more.
"""

import json
import os
import shutil
import signal
import sys
from pathlib import Path

from plateau.client import Client
from plateau.rendering.outputs import write_results

#: What changes a folder, as CPython's audit hooks call it.
_CHANGES = {"open", "os.rename", "os.remove", "os.mkdir", "os.rmdir"}
_O_WRITES = os.O_WRONLY | os.O_RDWR


def main(url: str, job_id: str, folder: Path, stride: int) -> None:
    step, ended = 0, False
    while not ended:
        there = folder / "there"
        shutil.rmtree(there, ignore_errors=True)
        shutil.copytree(folder / "before", there)
        child = os.fork()
        if child == 0:
            _die_before(step, there)
            _write(url, job_id, there)
            os._exit(0)
        ended = os.waitpid(child, 0)[1] == 0
        killed = _content(there)
        _write(url, job_id, there)
        print(json.dumps({"killed": killed, "again": _content(there)}))
        step += stride


def _write(url: str, job_id: str, folder: Path) -> None:
    with Client(url) as client:
        write_results(client, client.job(job_id), folder)


def _die_before(step: int, folder: Path) -> None:
    done = 0

    def hook(event: str, about: tuple[object, ...]) -> None:
        nonlocal done
        if event not in _CHANGES or not str(about[0]).startswith(str(folder)):
            return
        if event == "open" and not (isinstance(about[2], int) and about[2] & _O_WRITES):
            return
        if done == step:
            os.kill(os.getpid(), signal.SIGKILL)
        done += 1

    sys.addaudithook(hook)


def _content(folder: Path) -> dict[str, str]:
    files = (path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes().hex() for path in files}


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], Path(sys.argv[3]), int(sys.argv[4]))
