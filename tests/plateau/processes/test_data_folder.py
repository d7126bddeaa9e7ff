"""One process tree at a time uses a data folder."""

import subprocess
import sys
from pathlib import Path

import pytest

from plateau.processes import data_folder
from plateau.processes.data_folder import DataFolder, InUse, is_in_use


def test_who_inherits_the_lock_holds_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Given a process of a tree whose root was killed
    program = "import os, sys; os.write(1, b'x'); sys.stdin.read()"
    with DataFolder(tmp_path) as data:
        left = subprocess.Popen(
            [sys.executable, "-c", program],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            pass_fds=(data.lock_fd,),
        )
        assert left.stdout is not None
        left.stdout.read(1)
    (tmp_path / "lock").write_text('{"pid": 0, "url": ""}')
    # Then a new tree waits until it has left
    monkeypatch.setattr(data_folder, "_LEAVING_S", 0.3)
    with pytest.raises(InUse), DataFolder(tmp_path):
        pass
    left.communicate()
    with DataFolder(tmp_path):
        pass


def test_a_folder_without_a_lock_is_left_alone(tmp_path: Path) -> None:
    assert is_in_use(tmp_path)
