"""Reads deploy/containers/Containerfile, and does what it says without a container."""

import fnmatch
import re
import shlex
import shutil
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

from tests.cluster.support_chart import ROOT

FILE = ROOT / "deploy" / "containers" / "Containerfile"


@dataclass
class Stage:
    """What stands between one FROM and the next."""

    name: str
    base: str
    steps: list[tuple[str, str]] = field(default_factory=list)

    def all_of(self, instruction: str) -> list[str]:
        """The arguments of each such instruction."""
        return [argument for one, argument in self.steps if one == instruction]


def stages() -> dict[str, Stage]:
    """The stages by name, in order."""
    text = re.sub(r"\\\n", " ", re.sub(r"^#.*\n", "", FILE.read_text(), flags=re.MULTILINE))
    arguments: dict[str, str] = {}
    found: dict[str, Stage] = {}
    for line in filter(None, map(str.strip, text.splitlines())):
        instruction, _, argument = line.partition(" ")
        if instruction == "ARG":
            name, _, value = argument.partition("=")
            arguments[name] = value
        elif instruction == "FROM":
            base, name = re.fullmatch(r"(\S+) AS (\S+)", argument).groups()  # type: ignore[union-attr]
            base = re.sub(r"\$\{(\w+)\}", lambda match: arguments[match[1]], base)
            found[name] = Stage(name, base)
        else:
            list(found.values())[-1].steps.append((instruction, argument))
    return found


def ancestry(name: str) -> list[Stage]:
    """The stage and those that it rests on, the first of them first."""
    every = stages()
    line = [every[name]]
    while line[0].base in every:
        line.insert(0, every[line[0].base])
    return line


def in_context(path: str) -> bool:
    """Whether .dockerignore lets a path at the root into the build."""
    let_in = True
    for rule in (ROOT / ".dockerignore").read_text().splitlines():
        if rule and not rule.startswith("#") and fnmatch.fnmatch(path, rule.lstrip("!")):
            let_in = rule.startswith("!")
    return let_in


class Build:
    """Does what the stages do to `/src` and `/opt/plateau`, in a folder."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.sources = folder / "src"
        self.sources.mkdir(parents=True)

    def build(self) -> None:
        """Do the steps of the stage that all parts share."""
        for instruction, argument in stages()["build"].steps:
            if instruction == "COPY":
                self._copy(*argument.split())
            elif instruction == "RUN":
                self._run(argument, self._folder / "opt")

    def part(self, name: str) -> Path:
        """The interpreter of a part, once what it has no use for is taken away."""
        files = self._folder / name
        shutil.copytree(self._folder / "opt", files, symlinks=True)
        for step in stages()[f"{name}-files"].all_of("RUN"):
            self._run(step, files)
        return files / "bin" / "python"

    def _copy(self, *arguments: str) -> None:
        *sources, target = arguments
        for source in sources:
            assert in_context(source), f".dockerignore keeps {source} out"
            to = self.sources / target / (source if target == "./" else "")
            if (ROOT / source).is_dir():
                shutil.copytree(ROOT / source, to, ignore=shutil.ignore_patterns("__pycache__"))
            else:
                shutil.copy(ROOT / source, to)

    def _run(self, step: str, files: Path) -> None:
        # The image's Python is the machine's here, and needs no uv installed into it.
        uv = Path(sys.executable).with_name("uv")
        step = re.sub(r"python -m pip install .*? uv && ", "", re.sub(r"\s+", " ", step))
        step = re.sub(r"\buv venv\b", f"uv venv --python {sys.executable}", step)
        step = re.sub(r"\buv\b(?= (pip|venv))", shlex.quote(str(uv)), step)
        step = step.replace("/opt/plateau", shlex.quote(str(files)))
        done = subprocess.run(
            ["bash", "-euc", step], cwd=self.sources, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
