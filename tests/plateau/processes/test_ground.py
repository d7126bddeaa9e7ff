"""What the machine does not give is said before anything is started."""

import resource
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from plateau.errors import CommandFailed
from plateau.farm.process.settings import Settings
from plateau.processes.ground import check_ground


def test_one_sentence_says_what_to_set(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    settings = Settings(cache=tmp_path / "cache")
    long = tmp_path / ("l" * 100)
    long.mkdir()
    for temporary, says in {
        tmp_path / "missing": "missing, which is no folder: let it name another one",
        tmp_path / "file": "file, which is no folder",
        Path("/proc"): "cannot write into /proc (",
        long: "too long for the path of a socket: let TMPDIR name a folder of 66 characters",
    }.items():
        monkeypatch.setenv("TMPDIR", str(temporary))
        monkeypatch.setattr(tempfile, "tempdir", None)
        with pytest.raises(CommandFailed) as caught:
            check_ground(settings, caches=False, has_redis=True)
        assert says in str(caught.value)
    # A long one does for whoever has no socket there
    check_ground(settings, caches=True)
    check_ground(settings, caches=True, has_redis=True, data=Path("/tmp/data"))
    for cache, says in {"file": "file is a file", "file/x": "a file", "/proc/x": "(No"}.items():
        with pytest.raises(CommandFailed, match="PLATEAU_CACHE") as caught:
            check_ground(Settings(cache=tmp_path / cache), caches=True)
        assert says in str(caught.value)


@pytest.mark.parametrize("command", ["render scenes:box", "up --port 0", "worker"])
def test_where_few_files_may_be_open_nothing_is_started(tmp_path: Path, command: str) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "plateau", *command.split()],
        cwd=tmp_path,
        env={
            "PLATEAU_DATA": str(tmp_path / "data"),
            "PLATEAU_BLOBS": str(tmp_path / "blobs"),
            **({"PLATEAU_REDIS_URL": "redis://127.0.0.1:1"} if command == "worker" else {}),
        },
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (40, 40)),
        capture_output=True,
        encoding="utf-8",
        check=False,
    )
    said = "plateau: a process may open 40 files here, and Plateau needs 256: allow more (`ulimit"
    assert (done.returncode, done.stderr.startswith(said)) == (1, True), done.stderr
    assert list(tmp_path.iterdir()) == []
