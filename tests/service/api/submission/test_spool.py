"""The folder of a process's uploads."""

import logging
import tempfile
from pathlib import Path

import pytest

from plateau.service.api.process import spool_in


@pytest.fixture(autouse=True)
def untouched(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", None)
    monkeypatch.delenv("TMPDIR", raising=False)


def test_in_the_folder_that_is_given(tmp_path: Path) -> None:
    spool_in(tmp_path / "cache" / "uploads")
    assert Path(tempfile.gettempdir()) == tmp_path / "cache" / "uploads"


def test_where_tmpdir_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    spool_in(tmp_path / "uploads")
    assert Path(tempfile.gettempdir()) == tmp_path
    assert not (tmp_path / "uploads").exists()


def test_elsewhere_where_the_folder_cannot_be_made(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    before = tempfile.gettempdir()
    (tmp_path / "file").touch()
    with caplog.at_level(logging.WARNING):
        spool_in(tmp_path / "file" / "uploads")
    assert tempfile.gettempdir() == before
    assert f"uploads go to {before}" in caplog.text
