"""What the tests of engines render, what there is of it in the end, and what all engines do."""

import json
import re
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import psutil

from plateau.farm.images.exr import decode_image
from tests.support.processes.commands import Command, starting
from tests.support.until import until

#: Options of ``plateau render``: some seconds of one worker's.
JOB = (
    *("-D", "width=48", "-D", "height=48", "--step", "200", "--slice-spp", "50"),
    *("--variant", "scalar_rgb", "--rule", "fixed", "--allocation", "frame"),
    *("--spp", "1400", "--no-curve"),
)
#: Goes on for as long as a test may.
ENDLESS_JOB = tuple("500000" if one == "1400" else one for one in JOB)


#: The same as a data set of some seconds: ``plateau dataset``.
RECIPE = """
scenes = ["scenes:box"]
target = "fixed:spp=64"
spec = {variant = "scalar_rgb"}
parameters = {width = 48, height = 48, intensity = {from = 5, to = 25, count = 6}}
"""

Run = Callable[..., Command]

#: A monitor that stops, as by SIGSTOP, when a job needs no more samples and its pictures are due.
_STOPPING = """
import sys
if sys.orig_argv[2:4] == ["plateau", "monitor"]:
    from tests.support.faults.stages import arm
    where = "plateau.service.monitor.result_sets:ResultSets.write"
    arm({"where": where, "when": "before", "time": 1, "signal": "SIGSTOP", "target": "self"})
"""


@contextmanager
def commands(
    folder: Path, on: str, python: str = sys.executable, **environment: str
) -> Iterator[Run]:
    """Starts ``plateau render scenes:box --on …``, or a data set; none outlives the context."""
    recipe = folder / "recipe.toml"
    recipe.write_text(RECIPE)

    def start(
        *options: str, job: tuple[str, ...] = JOB, dataset: bool = False, **more: str
    ) -> Command:
        what = ("dataset", str(recipe)) if dataset else ("render", "scenes:box", *job)
        arguments = (*what, "-o", str(folder / "out"), "--on", on, *options)
        told = {"PLATEAU_LEASE_S": "2", **environment, **more}
        return Command(*arguments, folder=folder / "command", python=python, **told)

    yield from starting(start)


@dataclass(frozen=True)
class Result:
    """The image's bytes and the curve, but for the times of its points."""

    image: bytes
    curve: list[dict[str, Any]]


def result_of(command: Command, folder: Path) -> Result:
    """What a command has written, once it has ended well."""
    assert command.exit_code(400) == 0, command.said
    told = json.loads((folder / "summary.json").read_text())
    curve = [{name: one[name] for name in one if name != "at"} for one in told["curve"]]
    return Result(decode_image((folder / "image.exr").read_bytes()).tobytes(), curve)


def alone(folder: Path) -> Result:
    """What the command makes of the job without an engine."""
    command = Command("render", "scenes:box", "-o", str(folder / "out"), *JOB, folder=folder)
    return result_of(command, folder / "out")


#: Programs in place of a node's interpreter, and what the command then says of it.
UNFIT = {
    "no interpreter": ("", r"it cannot run Plateau by /\S*/python; install .*No such file"),
    "no Plateau": (
        '#!/bin/sh\nexec /usr/bin/env -i /usr/bin/python3 "$@"\n',
        r"it cannot run Plateau by .*No module named",
    ),
    "another version": (
        f"""#!/bin/sh\nexec {sys.executable} -c 'import sys, plateau.farm.model.versions as v
v.plateau = lambda: "0.0.9"\nexec(sys.argv[2])' "$@"\n""",
        r"it has another Plateau than this machine's .* has 0\.0\.9",
    ),
}


def interpreter(folder: Path, program: str) -> str:
    """The path of a node's interpreter, which is this program."""
    path = folder / "python"
    if program:
        path.write_text(program)
        path.chmod(0o755)
    return str(path)


def is_refused(run: Run, node: str, folder: Path) -> None:
    """The command ends at once, and says what is wrong with its nodes: one of `UNFIT`."""
    program, words = UNFIT[node]
    python = interpreter(folder, program)
    command = run("--workers", "2", dataset=node == "no Plateau", PLATEAU_PYTHON=python)
    assert command.exit_code() == 1
    assert "no node can work for this run: " in command.said
    assert re.search(words, command.said), command.said
    command.is_gone()


def stopping(folder: Path) -> dict[str, str]:
    """The environment of a command for `are_back_before_the_results`."""
    (folder / "sitecustomize.py").write_text(_STOPPING)
    return {"PYTHONPATH": f"{folder}:{Path(__file__).parents[2]}"}


def are_back_before_the_results(
    command: Command, folder: Path, are_back: Callable[[], bool]
) -> Result:
    """The nodes go while the last pictures wait to be made; returns what comes after all."""
    monitor = command.member("monitor")
    until(lambda: monitor.status() == psutil.STATUS_STOPPED, 400, lambda: command.said)
    until(are_back, complaint=lambda: f"nodes are kept for the results: {command.said}")
    assert not folder.exists() or not any(folder.rglob("image.exr"))
    monitor.send_signal(signal.SIGCONT)
    return result_of(command, folder)
