"""What was answered with 2xx survives a power loss, and with it the kernel's memory.

The data folder lies on a disk that keeps in memory what it may (`tests.support.faults.loop_disk`).
A writer is at work; at a random moment every process is killed, and the disk is taken as it is. The
controls do the same without one of the syncs, and lose what was acknowledged: the test can fail.
"""

import hashlib
import os
import random
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import psutil
import pytest
import redis

from plateau.client import Client, ClientError
from plateau.farm.blobs import names as blobs
from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.model.errors import JobNotFound
from plateau.farm.model.states import JobState
from plateau.farm.redis.embedded import EmbeddedRedis
from plateau.farm.redis.link import connect
from plateau.farm.wire.views import JobView
from tests.support import long_tests
from tests.support.farms.live_api import live_api
from tests.support.faults.loop_disk import LoopDisk
from tests.support.processes.commands import Command
from tests.support.scenes.bundles import scene
from tests.support.until import until

SEEDS = range(20 if long_tests.WANTED else 1)
READY = r"listens at (http://127\.0\.0\.1:\d+)"

#: Puts blobs for ever, and says which were acknowledged; its second argument is a line of Python.
WRITER = """
import hashlib, os, sys
from pathlib import Path
where, put = Path(sys.argv[1]), None
exec(sys.argv[2])
while True:
    content = os.urandom(50_000)
    name = "scenes/" + hashlib.sha256(content).hexdigest()
    put(name, content)
    print(name, flush=True)
"""
BY_BLOBS = "from plateau.farm.blobs.store import Blobs; put = Blobs(str(where)).put"
BY_OBSTORE = """
import obstore; from obstore.store import LocalStore
store = LocalStore(where, mkdir=True); put = lambda name, content: obstore.put(store, name, content)
"""


class TestJobs:
    @pytest.mark.parametrize("seed", SEEDS)
    def test_acknowledged_are_there_with_their_scenes(self, seed: int, tmp_path: Path) -> None:
        acknowledged, lost, torn = _submit_until_the_power_goes(tmp_path, random.Random(seed))
        assert acknowledged
        assert lost == []
        assert torn == []

    def test_would_be_lost_without_fsync(self, tmp_path: Path) -> None:
        def no_fsync(client: redis.Redis) -> None:
            client.config_set("appendfsync", "no")

        assert any(
            _submit_until_the_power_goes(tmp_path / str(n), random.Random(n), no_fsync)[1]
            for n in range(3)
        )


class TestBlobs:
    @pytest.mark.parametrize("seed", SEEDS)
    def test_acknowledged_are_there(self, seed: int, tmp_path: Path) -> None:
        acknowledged, lost = _put_until_the_power_goes(tmp_path, random.Random(seed), BY_BLOBS)
        assert acknowledged
        assert lost == []

    def test_would_be_lost_without_fsync(self, tmp_path: Path) -> None:
        # The kernel may have written all of it just before
        tries = (
            _put_until_the_power_goes(tmp_path / str(n), random.Random(n), BY_OBSTORE)
            for n in range(3)
        )
        assert any(lost for _, lost in tries)


def test_no_acknowledged_job_goes_with_a_redis_that_is_killed(tmp_path: Path) -> None:
    server = EmbeddedRedis(tmp_path / "redis")
    try:
        with live_api(server.url, Blobs(str(tmp_path / "blobs"))) as url, Client(url) as client:
            for number in range(50 if long_tests.WANTED else 4):
                # If Redis is killed as soon as the job was acknowledged
                job = client.submit(_scene(tmp_path, number))
                server.process.kill()
                server.stop()
                server = EmbeddedRedis(tmp_path / "redis")
                # Then it is there, and the API has found the new server
                assert client.job(job.id).scene_sha256 == job.scene_sha256
            assert len(list(client.all_jobs())) == number + 1
    finally:
        server.stop()


class TestALogWhoseLastWriteDidNotGetToTheDisk:
    """Its length may have: then it ends in zeros, on which Redis does not start."""

    @pytest.mark.parametrize("begun", [b"*3\r\n$3\r\nSET\r\n$1", *long_tests.rare(b"")])
    @pytest.mark.parametrize("zeros", [9, 3000, 20_000])
    def test_is_that_of_the_writes_before(self, begun: bytes, zeros: int, tmp_path: Path) -> None:
        with _redis(tmp_path) as client:
            client.set("a", "1")
        log = next(one for one in tmp_path.rglob("*.aof") if one.stat().st_size)
        with log.open("ab") as file:
            file.write(begun + bytes(zeros))
        with _redis(tmp_path) as client:
            assert client.get("a") == "1"
            client.set("b", "2")
        with _redis(tmp_path) as client:
            assert client.mget("a", "b") == ["1", "2"]

    def test_is_not_cut_where_it_was_just_rewritten(self, tmp_path: Path) -> None:
        with _redis(tmp_path) as client:
            client.set("a", "1")
            client.bgrewriteaof()
            until(lambda: client.info("persistence")["aof_rewrite_in_progress"] == 0)
        logs = {log: log.read_bytes() for log in tmp_path.rglob("*.aof")}
        with _redis(tmp_path) as client:
            assert client.get("a") == "1"
        assert {log: log.read_bytes() for log in logs} == logs


def _submit_until_the_power_goes(
    folder: Path, rng: random.Random, prepare: Callable[[redis.Redis], None] = lambda _: None
) -> tuple[list[JobView], list[str], list[str]]:
    """Jobs and cancellations that were acknowledged; those then lost; those without their scene."""
    acknowledged: list[JobView] = []
    with LoopDisk(folder / "disk") as disk:
        data = disk.folder / "data"
        with _up(folder, data) as service:
            url = service.wait_for(READY)
            # Not in its folder where that has a long path, as it has here
            with connect(service.wait_for(r"PLATEAU_REDIS_URL=(\S+)"), 120.0) as client:
                prepare(client)
            switch = threading.Timer(rng.uniform(0.5, 2), _kill_at_once, (service,))
            with Client(url, patience_s=120) as patient, Client(url, patience_s=0) as http:
                acknowledged.append(patient.submit(_scene(folder, 10_000)))
                switch.start()
                for number in range(10_000):
                    try:
                        acknowledged.append(http.submit(_scene(folder, number)))
                        if number % 3 == 0:
                            acknowledged[-1] = http.cancel(acknowledged[-1].id)
                    except ClientError:
                        break
            switch.join()
            after = disk.after_power_loss(folder / "after")
    with after, _redis(after.folder / "data" / "redis") as client:
        jobs, store = Jobs(client), Blobs(str(after.folder / "data" / "blobs"))
        lost = [job.id for job in acknowledged if not _is_known(jobs, job)]
        torn = [
            job.id for job in acknowledged if not _is_whole(store, blobs.scene(job.scene_sha256))
        ]
    return acknowledged, lost, torn


def _put_until_the_power_goes(
    folder: Path, rng: random.Random, how: str
) -> tuple[list[str], list[str]]:
    """The blobs that were acknowledged, and those of them that were then lost."""
    with LoopDisk(folder / "disk") as disk:
        writer = subprocess.Popen(
            [sys.executable, "-c", WRITER, str(disk.folder / "blobs"), how],
            stdout=subprocess.PIPE,
            text=True,
        )
        try:
            assert writer.stdout is not None
            first = writer.stdout.readline().strip()
            time.sleep(rng.uniform(0.2, 1))
        finally:
            writer.kill()
            rest, _ = writer.communicate()
        after = disk.after_power_loss(folder / "after")
    # What it had not finished saying was acknowledged all the same, but is not known to us.
    acknowledged = [first, *rest[: rest.rfind("\n") + 1].split()]
    with after:
        store = Blobs(str(after.folder / "blobs"))
        return acknowledged, [name for name in acknowledged if not _is_whole(store, name)]


def _kill_at_once(service: Command) -> None:
    """End every process by force, Redis before anybody can ask it to stop in order."""
    family = service.family()
    service.process.send_signal(signal.SIGSTOP)
    for is_turn in (lambda name: "redis" in name, lambda _: True):
        for one in family:
            with suppress(psutil.NoSuchProcess):  # a child goes with its parent
                if is_turn(one.name()):
                    one.kill()
    service.process.kill()
    psutil.wait_procs(family, timeout=10)


def _up(folder: Path, data: Path) -> Command:
    return Command("up", "--workers", "0", "--port", "0", folder=folder, PLATEAU_DATA=str(data))


@contextmanager
def _redis(folder: Path) -> Iterator[redis.Redis]:
    server = EmbeddedRedis(folder)
    try:
        with connect(server.url, 120.0) as client:
            yield client
    finally:
        server.stop()


def _scene(folder: Path, number: int) -> Path:
    """A scene like no other, of some 50 kB."""
    path = folder / "scene.xml"
    path.write_bytes(scene(f"<!-- {number} {os.urandom(25_000).hex()} -->"))
    return path


def _is_known(jobs: Jobs, job: JobView) -> bool:
    try:
        found = jobs.get(job.id)
    except JobNotFound:
        return False
    cancelled = JobState.CANCELLED
    return found.scene_sha256 == job.scene_sha256 and (
        found.state is cancelled or job.state is not cancelled
    )


def _is_whole(store: Blobs, name: str) -> bool:
    """Whether the blob is there with the bytes that its name, their SHA-256, says."""
    if not store.exists(name):
        return False
    return name == blobs.scene(hashlib.sha256(store.get(name)).hexdigest())
