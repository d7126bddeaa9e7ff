"""Reads deploy/containers/Containerfile."""

import fnmatch
import re
from dataclasses import dataclass, field

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
