"""Plateau stays small enough for one head: how much there may be of each of its parts.

A figure with an aim beside it is what there was on 2026-11-30: it may only fall. Who raises one
writes a dated decision that names the user who needs it, and what goes instead.
"""

import os
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest
import typer.main

from plateau.commands import app, meet_extensions
from plateau.farm.process.settings import Settings
from plateau.farm.redis import keys
from tests.support.api_document import api_document

ROOT = Path(__file__).parents[1]
CODE = (".py", ".lua", ".js", ".css")
EXTENSIONS = ("plateau/study", "plateau/cycles")
#: What others wrote, and what is made from something else.
NOT_OURS = {"vendor", "__pycache__"}


def lines(*folders: str, kinds: tuple[str, ...] = CODE) -> Counter[str]:
    """The lines of each room, a folder three levels below the top; a link to a folder is none."""
    rooms: Counter[str] = Counter()
    for path in files(*folders, kinds=kinds):
        room = "/".join(path.relative_to(ROOT).parts[:3])
        rooms[room] += len(path.read_text("utf-8").splitlines())
    return rooms


def files(*folders: str, kinds: tuple[str, ...]) -> Iterator[Path]:
    for folder in folders:
        for path, below, names in os.walk(ROOT / folder):
            inner = {name: str(Path(path, name).relative_to(ROOT)) for name in below}
            left_out = NOT_OURS | (set(EXTENSIONS) - {folder})
            below[:] = [name for name in inner if not {name, inner[name]} & left_out]
            yield from (Path(path, name) for name in names if name.endswith(kinds))


def within(found: Counter[str], most: int) -> None:
    largest = ", ".join(f"{room} {count:,}" for room, count in found.most_common(12))
    assert found.total() <= most, f"{found.total():,} of at most {most:,}; the largest: {largest}"


@pytest.mark.parametrize(
    ("folders", "kinds", "most"),
    [
        (("plateau",), CODE, 61_140),  # the aim: 60,000
        (EXTENSIONS, CODE, 5_000),
        (("bench",), CODE, 4_130),  # the aim: 4,000
        (("bench",), (".json", ".csv"), 5_000),
        (("tests",), CODE, 51_160),  # the aim: 46,000
        (("plateau/farm/redis/lua",), (".lua",), 1_800),
    ],
    ids=["core", "extensions", "bench", "results of bench", "tests", "Lua"],
)
def test_lines(folders: tuple[str, ...], kinds: tuple[str, ...], most: int) -> None:
    within(lines(*folders, kinds=kinds), most)


def test_words_of_prose() -> None:
    pages = [*ROOT.glob("*.md"), *files("docs", "deploy", "bench", "plateau", kinds=(".md",))]
    words = {str(page.relative_to(ROOT)): len(page.read_text("utf-8").split()) for page in pages}
    within(Counter(words), 60_000)


def test_routes() -> None:
    routes = Counter(
        path.split("/")[2] if path.startswith("/v1/") else path
        for path, calls in api_document()["paths"].items()
        for _ in calls
    )
    within(routes, 65)


def test_commands() -> None:
    meet_extensions()
    within(Counter(commands(typer.main.get_command(app))), 36)


def commands(command: object, name: str = "") -> Iterator[str]:
    below = getattr(command, "commands", {})
    for each, one in below.items():
        yield from commands(one, name or each)
    if not below:
        yield name


def test_settings() -> None:
    within(Counter(name.partition("_")[0] for name in Settings.model_fields), 32)


def test_keys_of_redis() -> None:
    rows = re.findall(r"^plateau:(\w+)", keys.__doc__ or "", re.MULTILINE)
    within(Counter(rows), 60)
