"""The Python in the docs does what they say: every block is run, in order, on a real farm."""

import re
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest

import plateau
from plateau.client import DEFAULT_URL
from tests.support.farms.real_farm import RealFarm

ROOT = Path(__file__).parents[2]
BLOCK = re.compile(r"^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def python_of(document: Path) -> Iterator[str]:
    """The file's blocks, each with its line numbers, so that an error points into the file."""
    text = document.read_text()
    for block in BLOCK.finditer(text):
        yield "\n" * text.count("\n", 0, block.start(1)) + block.group(1)


@pytest.mark.parametrize("name", ["docs/client.md", "docs/api.md"])
def test_every_block_runs(
    name: str, staffed: RealFarm, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Given the service that the docs speak of, at another address, and a folder with the scenes
    (tmp_path / "scenes").symlink_to(ROOT / "scenes")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(plateau, "render", partial(plateau.render, farm=staffed.client.url))
    blocks = list(python_of(ROOT / name))
    assert blocks, "no Python to run"
    assert any(DEFAULT_URL in block for block in blocks)
    # Then each block runs, with what those before it have left
    namespace: dict[str, object] = {}
    for block in blocks:
        exec(
            compile(block.replace(DEFAULT_URL, staffed.client.url), ROOT / name, "exec"), namespace
        )
