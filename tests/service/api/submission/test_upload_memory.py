"""A big bundle goes through the API and leaves its memory alone.

A real API process takes a real zip over HTTP. ``LONG_TESTS=1`` sends 2 GB instead of 150 MB;
``pytest -s`` shows the figures of docs/operations.md.
"""

import http.client
import os
import statistics
import threading
import time
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from urllib.parse import urlsplit

import psutil
import pytest

from plateau.farm.blobs import names as blobs
from tests.support import long_tests
from tests.support.farms.real_farm import RealFarm

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
    """A zip of so many entries of a million bytes that no method makes smaller."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr("scene.xml", SCENE)
        for number in range(megabytes):
            archive.writestr(f"mesh-{number}.ply", os.urandom(1_000_000))


class Upload:
    """A POST of a file, and when its last byte was sent and when it was answered."""

    def __init__(self, url: str, file: Path) -> None:
        edge = "edge-of-a-part"
        head = (
            f'--{edge}\r\nContent-Disposition: form-data; name="scene"; filename="big.zip"\r\n\r\n'
        ).encode()
        tail = f"\r\n--{edge}--\r\n".encode()
        address = urlsplit(url)
        self._http = http.client.HTTPConnection(address.hostname or "", address.port, timeout=600)
        self._http.putrequest("POST", "/v1/jobs")
        self._http.putheader("Content-Type", f"multipart/form-data; boundary={edge}")
        self._http.putheader("Content-Length", str(len(head) + file.stat().st_size + len(tail)))
        self._http.endheaders(head)
        started = time.monotonic()
        with file.open("rb") as content:
            self._http.sock.sendfile(content)
        self._http.sock.sendall(tail)
        self.sent_at = time.monotonic()
        answer = self._http.getresponse()
        assert answer.status == 201, answer.read()
        answer.read()
        self.answered_at = time.monotonic()
        self._http.close()
        self.sending_s = self.sent_at - started
        self.finishing_s = self.answered_at - self.sent_at


@contextmanager
def beside(work: Callable[[], None], pause_s: float) -> Iterator[None]:
    """Do this again and again in a thread, while the context lasts."""
    over, failed = threading.Event(), list[BaseException]()

    def again_and_again() -> None:
        try:
            while not over.wait(pause_s):
                work()
        except BaseException as error:
            failed.append(error)
            raise

    thread = threading.Thread(target=again_and_again)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()
    assert not failed


def open_without_a_name(pid: int) -> set[Path]:
    """The folders in which a process has files open that have no name."""
    folders = set()
    for descriptor in Path(f"/proc/{pid}/fd").iterdir():
        with suppress(FileNotFoundError):
            target = descriptor.readlink()
            if target.name.endswith("(deleted)"):
                folders.add(target.parent)
    return folders


@pytest.mark.timeout(1200)
def test_a_big_bundle_is_never_in_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("TMPDIR", raising=False)
    # Given a bundle of incompressible meshes, and an API that was used a little
    bundle = tmp_path / "big.zip"
    write_bundle(bundle, MEGABYTES)
    with RealFarm(tmp_path, tmp_path / "cache") as farm:
        job = farm.submit()
        farm.client.job(job.id)
        api = psutil.Process(farm.processes[0].pid)
        before = api.memory_full_info()
        memory, waits = [before], list[tuple[float, float]]()
        spooled: set[Path] = set()

        def look() -> None:
            memory.append(api.memory_full_info())
            spooled.update(open_without_a_name(api.pid))

        def ask() -> None:
            asked = time.monotonic()
            farm.client.job(job.id)
            waits.append((asked, time.monotonic() - asked))

        # When it is sent, and somebody asks for a job meanwhile
        with beside(look, 0.02), beside(ask, 0.02):
            upload = Upload(farm.client.url, bundle)
        # Then the farm has it
        sizes = {blob.name: blob.size for blob in farm.store.listing(blobs.SCENES)}
        assert bundle.stat().st_size in sizes.values()
        # And it lay on the disk of the cache: /tmp may be memory
        assert tmp_path / "cache" / "uploads" in spooled
        # And the API's memory is what it was
        uss = max(one.uss for one in memory) - before.uss
        rss = max(one.rss for one in memory) - before.rss
        assert max(uss, rss) < MOST_GROWTH
        during = [wait for asked, wait in waits if asked < upload.sent_at]
        after = [wait for asked, wait in waits if upload.sent_at < asked < upload.answered_at]
        # And others were served meanwhile
        assert during
        print(f"\n{bundle.stat().st_size:,} bytes sent in {upload.sending_s:.1f} s", end=", ")
        print(f"answered {upload.finishing_s:.1f} s later")
        print(f"API: {before.rss:,} resident before, {rss:,} more at most; its own {uss:,} more")
        for when, ones in (("while it was sent", during), ("until it was answered", after)):
            if ones:
                middle, most = 1000 * statistics.median(ones), 1000 * max(ones)
                print(f"GET of a job {when}: {middle:.1f} ms, {most:.0f} at most ({len(ones)})")
