"""A big bundle goes through the API and leaves its memory alone.

A real API process takes a real zip over HTTP. ``LONG_TESTS=1`` sends 2 GB instead of 150 MB.
"""

import logging
import tempfile
import zipfile
from contextlib import suppress
from pathlib import Path

import httpx
import psutil
import pytest

from plateau.farm.blobs import names as blobs
from plateau.service.api.process import spool_in
from tests.support import long_tests
from tests.support.farms.real_farm import RealFarm
from tests.support.missing import of_root
from tests.support.threads import beside

MEGABYTES = 2000 if long_tests.WANTED else 150
#: What the API may take more than before. The store's own client holds some parts of what is put.
MOST_GROWTH = 100_000_000

SCENE = b"""<scene version="3.0.0">
  <sensor type="perspective"><film type="hdrfilm">
    <integer name="width" value="64"/><integer name="height" value="64"/>
  </film></sensor>
  <shape type="ply"><string name="filename" value="mesh-0.ply"/></shape>
</scene>"""


def write_bundle(path: Path, megabytes: int) -> None:
    """A zip of so many entries of a million bytes."""
    content = bytes(1_000_000)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr("scene.xml", SCENE)
        for number in range(megabytes):
            archive.writestr(f"mesh-{number}.ply", content)


def open_without_a_name(pid: int) -> set[Path]:
    """The folders in which a process has files open that have no name."""
    folders = set()
    for descriptor in Path(f"/proc/{pid}/fd").iterdir():
        with suppress(FileNotFoundError):
            target = descriptor.readlink()
            if target.name.endswith("(deleted)"):
                folders.add(target.parent)
    return folders


@of_root
@pytest.mark.timeout(1200)
def test_a_big_bundle_is_never_in_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("TMPDIR", raising=False)
    # Given a bundle of incompressible meshes, and an API that was used a little
    bundle = tmp_path / "big.zip"
    write_bundle(bundle, MEGABYTES)
    with RealFarm(tmp_path, tmp_path / "cache", plain=True) as farm:
        job = farm.submit()
        farm.client.job(job.id)
        api = psutil.Process(farm.processes[0].pid)
        before = api.memory_full_info()
        memory, waits = [before], 0
        spooled: set[Path] = set()

        def look() -> None:
            memory.append(api.memory_full_info())
            spooled.update(open_without_a_name(api.pid))

        def ask() -> None:
            nonlocal waits
            farm.client.job(job.id)
            waits += 1

        # When it is sent, and somebody asks for a job meanwhile
        with beside(look, 0.02), beside(ask, 0.02), bundle.open("rb") as file:
            answer = httpx.post(f"{farm.url}/v1/jobs", files={"scene": file}, timeout=600)
        assert answer.status_code == 201, answer.text
        # Then the farm has it
        sizes = {blob.name: blob.size for blob in farm.store.listing(blobs.SCENES)}
        assert bundle.stat().st_size in sizes.values()
        # And it lay on the disk of the cache: /tmp may be memory
        assert tmp_path / "cache" / "uploads" in spooled
        # And the API's memory is what it was
        uss = max(one.uss for one in memory) - before.uss
        rss = max(one.rss for one in memory) - before.rss
        assert max(uss, rss) < MOST_GROWTH
        # And others were served meanwhile
        assert waits


@pytest.fixture(autouse=True)
def untouched(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", None)
    monkeypatch.delenv("TMPDIR", raising=False)


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
