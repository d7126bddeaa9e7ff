"""Who writes into a folder, or a file, has it alone."""

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
import redis

import plateau as package
from plateau.client import Client
from plateau.farm.images.exr import encode_layers
from plateau.farm.model.job import utc_now
from plateau.files.held import Held, held
from plateau.files.job_folder import whole
from plateau.rendering.result import Result
from tests.support.farms.staged_job import StagedJob
from tests.support.processes.commands import plateau as command

HOLDS = (
    "import sys; from pathlib import Path; from plateau.files.held import held\n"
    "with held(Path(sys.argv[1])): print('held', flush=True); sys.stdin.read()"
)


def test_it_is_said_who_holds_it_and_a_dead_holder_keeps_nobody_out(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "clean.exr"):
        with subprocess.Popen(
            [sys.executable, "-c", HOLDS, str(path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
        ) as other:
            assert other.stdout is not None
            assert other.stdout.readline() == b"held\n"
            said = (
                rf"{path} is being written by process {other.pid} since {utc_now():%Y}-.*: wait "
                "until that has ended, or give another one with -o"
            )
            with pytest.raises(Held, match=said), held(path):
                pass
            other.kill()
        with held(path), pytest.raises(Held, match=f"process {os.getpid()} since"), held(path):
            pass
    assert list(tmp_path.iterdir()) == []


def test_one_of_many_threads_has_it_at_a_time(tmp_path: Path) -> None:
    inside: list[int] = []
    most: list[int] = []

    def work() -> None:
        for _ in range(200):
            try:
                with held(tmp_path):
                    inside.append(1)
                    most.append(len(inside))
                    inside.pop()
            except Held:
                pass

    with ThreadPoolExecutor(4) as pool:
        list(pool.map(lambda _: work(), range(4)))
    assert set(most) == {1}
    assert list(tmp_path.iterdir()) == []


def test_where_there_is_no_lock_it_goes_on() -> None:
    with held(Path("/proc")), held(Path("/proc")):
        pass


def test_a_file_is_written_whole_and_what_was_left_is_cleaned(tmp_path: Path) -> None:
    file = tmp_path / "image.exr"
    file.write_text("old")
    (tmp_path / ".image.exr.part").write_text("of a process that was killed")
    with pytest.raises(FileNotFoundError), whole(file) as path:
        path.with_name("missing").read_text()
    assert [path.name for path in tmp_path.iterdir()] == ["image.exr"]
    with whole(file) as path:
        path.write_text("new")
        with pytest.raises(Held), whole(file):
            pass
        assert file.read_text() == "old"
    assert file.read_text() == "new"
    with held(tmp_path), pytest.raises(Held), whole(file):
        pass
    with whole(Path("/dev/null")) as path:
        path.write_text("to nobody")


@pytest.mark.usefixtures("_service")
def test_no_command_and_no_call_writes_where_another_does(
    plateau: Client, client: redis.Redis, tmp_path: Path
) -> None:
    job = StagedJob(client, batch="w")
    job.commit(1)
    job.point(100, 5)
    job.end()
    job.finish()
    out, image = tmp_path / "out", tmp_path / "a.exr"
    slices = tmp_path / "slices"
    for folder in (out, slices):
        folder.mkdir()
    rgb = {name: np.zeros((8, 8), np.float32) for name in "RGB"}
    for path in (image, tmp_path / "b.exr"):
        path.write_bytes(encode_layers(rgb, {}))
    images = [str(image), str(tmp_path / "b.exr")]
    clean = out / "0000.exr"
    with held(out), held(clean):
        before = sorted(tmp_path.rglob("*"))
        for words in (
            ["fetch", job.id, "-o", str(out)],
            ["watch", job.id, "-o", str(out)],
            ["watch", "--batch", "w", "-o", str(out)],
            ["render", "scenes:box", "-o", str(out)],
            ["judge", str(slices), "-o", str(out)],
            ["diff", *images, "--map", str(clean)],
        ):
            code, printed, said = command(*words)
            assert (code, printed) == (1, ""), words
            assert f" is being written by process {os.getpid()} since " in said, (words, said)
        with pytest.raises(Held):
            package.render("scenes:box", out=out)
        result = Result.fetched(plateau, plateau.job(job.id))
        with pytest.raises(Held):
            result.save(out)
        with pytest.raises(Held):
            plateau.download(job.id, "image.png", out / "image.png")
        assert sorted(tmp_path.rglob("*")) == before
    assert command("fetch", job.id, "-o", str(out))[0] == 0
