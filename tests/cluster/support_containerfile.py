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
    """Does what the stages do to `/src`, `/wheel` and `/opt/plateau`, in a folder."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.sources = folder / "src"
        self.sources.mkdir(parents=True)

    def build(self) -> None:
        """Do the steps of the stages that all parts share."""
        for name in ("build", "wheel"):
            self._do(stages()[name], self._folder / "opt")

    def part(self, name: str) -> Path:
        """The interpreter of a part, once it is installed."""
        files = self._folder / name
        shutil.copytree(self._folder / "opt", files, symlinks=True)
        self._do(stages()[f"{name}-files"], files)
        return files / "bin" / "python"

    def _do(self, stage: Stage, files: Path) -> None:
        for instruction, argument in stage.steps:
            if instruction == "COPY":
                self._copy(*argument.split())
            elif instruction == "RUN":
                self._run(argument, files)

    def _copy(self, *arguments: str) -> None:
        *sources, target = arguments
        for source in sources:
            if source.startswith("--from="):  # the wheel, which lies where it is looked for
                return
            assert in_context(source), f".dockerignore keeps {source} out"
            to = self.sources / target / (source if target == "./" else "")
            if (ROOT / source).is_dir():
                ignored = shutil.ignore_patterns("__pycache__")
                shutil.copytree(ROOT / source, to, symlinks=True, ignore=ignored)
            else:
                shutil.copy(ROOT / source, to)

    def _run(self, step: str, files: Path) -> None:
        # The image's Python is the machine's here, and needs no uv installed into it.
        uv = Path(sys.executable).with_name("uv")
        step = re.sub(r"python -m pip install .*? uv && ", "", re.sub(r"\s+", " ", step))
        step = re.sub(r"\buv venv\b", f"uv venv --python {sys.executable}", step)
        step = re.sub(r"\buv\b(?= (build|pip|venv))", shlex.quote(str(uv)), step)
        step = step.replace("/opt/plateau", shlex.quote(str(files)))
        step = step.replace("/wheel", shlex.quote(str(self._folder / "wheel")))
        done = subprocess.run(
            ["bash", "-euc", step], cwd=self.sources, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
