"""Extensions: their names appear in their own folders, and the core does without them."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.processes.commands import Command
from tests.support.without_extensions import without

ROOT = Path(__file__).parents[2]
#: What is written by hand of the core and its deployment.
ROOMS = ("plateau", "deploy")
KINDS = {".py", ".lua", ".js", ".ts", ".css", ".html", ".json", ".yaml", ".toml", ".sh"}
#: Of each extension: its folder, and what only it says. (Vision has cycles of its own.)
EXTENSIONS = {
    "plateau/cycles": r"\bbpy\b|[Bb]lender\b|[\"'` ]\.blend\b|scene\.blend|\bCycles\b|"
    r"\bcycles[:/]|[\"'.]cycles\b",
    "plateau/study": r"(?i)plateau\.study|\bstudies\b|\ba study\b|observer stud|[\"'`/:_]study\b",
}


def _files() -> Iterator[Path]:
    for room in ROOMS:
        for path in (ROOT / room).rglob("*"):
            is_made = "vendor" in path.parts or path.name.endswith(".d.ts")
            if path.suffix in KINDS and path.is_file() and not is_made:
                yield path


@pytest.mark.parametrize("folder", EXTENSIONS)
def test_its_name_appears_in_its_own_folder_only(folder: str) -> None:
    said = re.compile(EXTENSIONS[folder])
    own = ROOT / folder
    found = [
        f"{path.relative_to(ROOT)}:{number}: {line.strip()}"
        for path in _files()
        if not path.is_relative_to(own)
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if said.search(line)
    ]
    assert not found, "\n".join(found)
    assert any(said.search(path.read_text(encoding="utf-8")) for path in own.rglob("*.py"))


@pytest.fixture(scope="module")
def core(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A PYTHONPATH for the core alone."""
    modules = (f"plateau.{Path(folder).name}" for folder in EXTENSIONS)
    return without(tmp_path_factory.mktemp("core"), *modules)


def test_without_any_the_core_renders(core: str, tmp_path: Path) -> None:
    there = {"PYTHONPATH": core, "PLATEAU_CACHE": str(tmp_path / "cache")}
    (tmp_path / "shot.blend").write_bytes(b"BLENDER17-01v0501")
    render = Command("render", str(tmp_path / "shot.blend"), folder=tmp_path / "a", **there)
    assert render.exit_code(60) == 1
    assert "it is of no known kind" in render.said
    (tmp_path / "checks.json").write_text(json.dumps({"analytic": 1, "width": 16, "height": 16}))
    arguments = ("render", str(tmp_path / "checks.json"), "-o", str(tmp_path / "out"))
    options = ("--rule", "fixed:spp=100", "--workers", "1", "--threads", "1")
    with Command(*arguments, *options, folder=tmp_path / "b", **there) as render:
        assert render.exit_code(180) == 0, render.said
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["spp"] == 100


@pytest.mark.long
@pytest.mark.timeout(1300)  # as long as the whole suite may take on a busy machine
def test_without_any_the_tests_of_the_core_pass(core: str) -> None:
    tests = ("farm/bundle", "farm/model", "plateau/commands", "plateau/files", "service/api/routes")
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-n", "0", *(f"tests/{one}" for one in tests)],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": core},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
        timeout=1200,
    )
    assert done.returncode == 0, done.stdout[-5000:]
