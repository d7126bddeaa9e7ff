"""The job that the tests of engines render, and what there is of it in the end."""

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from plateau.farm.images.exr import decode_image
from tests.support.processes.commands import Command

#: Options of ``plateau render``: some seconds of one worker's.
JOB = (
    *("-D", "width=48", "-D", "height=48", "--step", "200", "--slice-spp", "50"),
    *("--variant", "scalar_rgb", "--rule", "fixed", "--allocation", "frame"),
    *("--spp", "2000", "--no-curve"),
)
#: Goes on for as long as a test may.
ENDLESS_JOB = tuple("500000" if one == "2000" else one for one in JOB)


Run = Callable[..., Command]


@contextmanager
def commands(
    folder: Path, on: str, python: str = sys.executable, **environment: str
) -> Iterator[Run]:
    """Starts ``plateau render scenes:box --on …``; none outlives the context."""
    started: list[Command] = []

    def start(*options: str, job: tuple[str, ...] = JOB, **more: str) -> Command:
        arguments = ("render", "scenes:box", "-o", str(folder / "out"), *job, "--on", on, *options)
        told = {"PLATEAU_LEASE_S": "2", **environment, **more}
        started.append(Command(*arguments, folder=folder / "command", python=python, **told))
        return started[-1]

    yield start
    for command in started:
        command.end()


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
