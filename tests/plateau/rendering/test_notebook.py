"""Notebooks: the one of the docs does what it shows, and a cell can be stopped and run again."""

import base64
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.support.processes.commands import Command

DOCUMENTED = Path(__file__).parents[3] / "docs" / "notebook.ipynb"

Outputs = list[dict[str, Any]]
Execute = Callable[..., list[Outputs]]


@pytest.fixture
def execute(tmp_path: Path) -> Execute:
    """Runs a notebook in a fresh folder; returns the outputs of each of its code cells."""

    def run(notebook: dict[str, Any], *options: str) -> list[Outputs]:
        (tmp_path / "run.ipynb").write_text(json.dumps(notebook))
        # A home of its own, as settings of IPython lie there
        home = {"HOME": str(tmp_path), "PYTHONPATH": str(DOCUMENTED.parents[1])}
        arguments = (str(tmp_path / "run.ipynb"), *options)
        program = ("-W", "ignore", "-m", "tests.support.processes.notebook")
        with Command(*arguments, program=program, folder=tmp_path, **home) as command:
            assert command.exit_code(200) == 0, command.said
            command.is_gone()
            assert list(command.temporary.iterdir()) == []
        said = command.said
        cells = json.loads(said[said.index("\n{") if not said.startswith("{") else 0 :])["cells"]
        return [cell["outputs"] for cell in cells if cell["cell_type"] == "code"]

    return run


def shown(output: dict[str, Any]) -> str:
    """What a notebook shows of an output: its HTML, or its text."""
    text = output["data"]["text/html"] if "data" in output else output["text"]
    return "".join(text)


@pytest.mark.long
def test_the_documented_notebook_shows_what_it_has_shown(execute: Execute, tmp_path: Path) -> None:
    documented = json.loads(DOCUMENTED.read_text())
    before = [cell["outputs"] for cell in documented["cells"] if cell["cell_type"] == "code"]
    now = execute(documented)
    # Every cell has the outputs of the page, in the same forms
    kinds = [
        [[(one["output_type"], *sorted(one.get("data", ()))) for one in cell] for cell in cells]
        for cells in (before, now)
    ]
    assert kinds[0] == kinds[1]
    # The live view ends as a line, and the result is the picture, the curve and the words
    live, result = now[0]
    assert shown(live).startswith("<b>box</b> reached its cap at 100 spp · 64×64 · ")
    assert "<img" not in shown(live)
    assert shown(result).count("<img ") == shown(result).count("<svg ") == 1
    assert "reached the cap of 100 spp" in shown(result)
    png = base64.b64decode(result["data"]["image/png"])
    assert png.startswith(b"\x89PNG")
    # What is printed of it is the same on every machine
    assert shown(now[1][0]).splitlines()[0] == "reached its cap at 100 spp: (64, 64, 3) float32"
    assert "converged at 50 spp" in shown(now[2][1])
    assert shown(now[3][0]) == shown(before[3][0]) == "['B', 'G', 'R', 'Z']\nbox.exr box.png\n"
    assert (tmp_path / "box.exr").exists()


@pytest.mark.long
def test_the_stop_button_keeps_the_image_and_the_cell_can_run_again(execute: Execute) -> None:
    scene = {"analytic": 1, "width": 40, "height": 30, "light": "checks", "level": 0.2}
    source = (
        "import json, plateau\n"
        f"open('checks.json', 'w').write(json.dumps({scene}))\n"
        "plateau.render('checks.json', rule={'name': 'fixed', 'spp': 10**6}, max_spp=10**6)"
    )
    cell = {"cell_type": "code", "id": "one", "source": source, "metadata": {}, "outputs": []}
    notebook = {"cells": [cell], "metadata": {}, "nbformat": 4, "nbformat_minor": 5}
    # Each run is stopped when it shows an image
    ((live, result),) = execute(notebook, "stop")
    # Then it has ended like any other, with the picture so far and without a traceback
    assert shown(live).startswith("<b>checks</b> cancelled at ")
    assert result["output_type"] == "execute_result"
    assert "<img " in shown(result)
    assert "cancelled" in shown(result)
