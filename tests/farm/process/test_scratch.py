"""Nothing remains of a temporary folder, however its process ends."""

import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from plateau.farm.process.scratch import remove_left, scratch

_HOLDS_ONE = """
import sys, time
from plateau.farm.process.scratch import scratch
with scratch() as folder:
    (folder / "kernel").write_text("compiled")
    print(folder, flush=True)
    time.sleep(600)
"""


@pytest.fixture(autouse=True)
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    return tmp_path


def test_it_is_removed_at_the_end(temporary: Path) -> None:
    with scratch() as folder:
        (folder / "one").mkdir()
        assert [*temporary.iterdir()] == [folder]
    assert [*temporary.iterdir()] == []


def test_one_of_a_killed_process_is_removed_and_one_in_use_is_not(temporary: Path) -> None:
    with subprocess.Popen([sys.executable, "-c", _HOLDS_ONE], stdout=subprocess.PIPE) as holder:
        assert holder.stdout is not None
        theirs = Path(holder.stdout.readline().decode().strip())
        # While its process lives
        with scratch() as ours:
            remove_left()
            assert (theirs / "kernel").exists()
            assert ours.exists()
        holder.kill()
        holder.wait()
    assert theirs.exists()
    # And once it was killed
    remove_left()
    assert [*temporary.iterdir()] == []


def test_a_link_of_that_name_is_left_alone(temporary: Path) -> None:
    precious = temporary / "precious"
    precious.mkdir()
    (temporary / "plateau-scratch-link").symlink_to(precious)
    remove_left()
    assert precious.exists()
