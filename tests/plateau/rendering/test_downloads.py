"""What a job leaves is fetched whole, though the service is busy, breaks off, or starts again."""

import socket
import threading
from base64 import b64encode
from collections.abc import Iterator
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path

import pytest
import redis

from plateau.client import Client, Damaged, Unreachable
from plateau.farm.blobs.store import Blobs
from plateau.farm.model.job import Job
from plateau.rendering.outputs import write_results
from tests.support.farms.live_api import live_api
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.farms.staged_job import StagedJob
from tests.support.threads import working

SLICES = 12
#: Each connection has one answer: who sent a second request could meet its end.
OK = b"HTTP/1.1 200 OK\r\nConnection: close\r\n"
HALF = OK + b"Content-Length: 1000000\r\n\r\n" + bytes(1000)


@pytest.fixture
def farm(client: redis.Redis, redis_url: str, tmp_path: Path) -> NoiseFarm:
    return NoiseFarm(client, redis_url, tmp_path)


def job_with_slices(farm: NoiseFarm) -> Job:
    job = farm.submit(
        keep_slices=True,
        step=20,
        slice_spp=10,
        max_spp=10 * SLICES,
        rule={"name": "fixed", "spp": 10 * SLICES},
    )
    with farm.monitor():
        farm.render(SLICES)
    return job


def content(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_slices_that_are_there_are_not_fetched_again(
    farm: NoiseFarm, redis_url: str, tmp_path: Path
) -> None:
    job, other = job_with_slices(farm), job_with_slices(farm)
    slices = tmp_path / "out" / "slices"
    with live_api(redis_url, farm.store) as url, Client(url) as plateau:
        write_results(plateau, plateau.job(job.id), tmp_path / "out")
        fetched = content(slices)
        assert fetched == {
            f"{index:06d}.exr": farm.store.get(record["blob"])
            for index, record in farm.jobs.ledger(job.id).items()
        }
        # Given one that is missing, one that is damaged, and one of another job
        (slices / "000002.exr").unlink()
        (slices / "000003.exr").write_bytes(fetched["000003.exr"][:-1])
        plateau.download(other.id, "slices/4.exr", slices / "000004.exr")
        assert (slices / "000004.exr").read_bytes() != fetched["000004.exr"]
        before = {path.name: _stamp(path) for path in slices.iterdir()}
        # When the job is fetched again
        write_results(plateau, plateau.job(job.id), tmp_path / "out")
    # Then these three are as they should be, and the others are the very same files
    assert content(slices) == fetched
    same = {path.name for path in slices.iterdir() if before.get(path.name) == _stamp(path)}
    assert same == set(fetched) - {"000002.exr", "000003.exr", "000004.exr"}


def _stamp(path: Path) -> tuple[int, int]:
    """What no other file has: numbers alone are given again."""
    return path.stat().st_ino, path.stat().st_mtime_ns


def test_a_file_is_whole_though_the_service_broke_off_and_was_started_again(
    client: redis.Redis, redis_url: str, store: Blobs, tmp_path: Path
) -> None:
    job = StagedJob(client)
    job.commit()
    job.picture(store, "image.exr", b"a picture")
    out = tmp_path / "out"
    out.mkdir()
    with socket.create_server(("127.0.0.1", 0)) as dying:
        port = dying.getsockname()[1]
        with Client(f"http://127.0.0.1:{port}", patience_s=120) as plateau:
            download = threading.Thread(
                target=plateau.download, args=(job.id, "image.exr", out / "image.exr"), daemon=True
            )
            download.start()
            # Given a service that dies in the middle of it
            connection, _ = dying.accept()
            with connection:
                connection.recv(65536)
                connection.sendall(HALF)
            dying.close()
            # When another takes its place
            with live_api(redis_url, store, port=port):
                download.join(120)
    # Then the file is there, and nothing else
    assert content(out) == {"image.exr": b"a picture"}


def test_a_service_that_always_breaks_off_is_not_asked_for_ever(tmp_path: Path) -> None:
    with _always(HALF) as url, Client(url, patience_s=0.5) as plateau, pytest.raises(Unreachable):
        plateau.download("0123456789ab", "image.exr", tmp_path / "image.exr")
    assert list(tmp_path.iterdir()) == []


@contextmanager
def _always(answer: bytes) -> Iterator[str]:
    """A service that sends the same to each request, and hangs up."""

    def serve() -> None:
        while True:
            try:
                connection, _ = server.accept()
            except OSError:
                return
            with connection:
                connection.recv(65536)
                connection.sendall(answer)

    with (
        socket.create_server(("127.0.0.1", 0)) as server,
        working(serve, lambda: server.shutdown(socket.SHUT_RDWR)),
    ):
        yield f"http://127.0.0.1:{server.getsockname()[1]}"


def test_a_file_that_was_changed_on_its_way_is_not_kept(tmp_path: Path) -> None:
    # Given a proxy that changes a byte of a file, which has its SHA-256 with it
    named = b64encode(sha256(b"a picture").digest())
    head = OK + b"Content-Length: 9\r\nRepr-Digest: unixsum=:AAA=:, sha-256=:%s:\r\n\r\n"
    with _always(head % named + b"a pictuce") as url, Client(url, patience_s=0) as plateau:
        with pytest.raises(Damaged, match=r"image.exr was damaged on its way here"):
            plateau.download("0123456789ab", "image.exr", tmp_path / "image.exr")
        with pytest.raises(Damaged):
            plateau.image("0123456789ab", "image.exr")
    assert list(tmp_path.iterdir()) == []
    # And one that came as it was sent
    with _always(head % named + b"a picture") as url, Client(url, patience_s=0) as plateau:
        plateau.download("0123456789ab", "image.exr", tmp_path / "image.exr")
    assert content(tmp_path) == {"image.exr": b"a picture"}
