"""A farm whose blobs are in S3: the pixels are those of a folder, whatever the server does."""

import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from plateau.client import Client
from plateau.farm.images.exr import decode_image
from plateau.farm.ledger.workers import Workers
from tests.cluster.support_s3 import BUCKET, SECRET, Network, S3Server
from tests.support.farms.faulty_farm import SPEC, FaultyFarm
from tests.support.farms.real_farm import BOX
from tests.support.faults.invariants import Outcome, assert_same, outcome
from tests.support.processes.commands import Command
from tests.support.until import until

#: Longer than a lease of these farms, which is 2 s.
LONGER_THAN_A_LEASE_S = 4.0
#: A worker that stops tries for 5 s to commit what it has, and a try may last for 3 s more.
STOPS_WITHIN_S = 15.0

POLICIES = Path(__file__).parents[2] / "deploy" / "s3"


@pytest.fixture(scope="module")
def server(
    tool: Callable[[str], Path], tmp_path_factory: pytest.TempPathFactory
) -> Iterator[S3Server]:
    with S3Server(tool("versitygw"), tmp_path_factory.mktemp("s3")) as server:
        yield server


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory, cache: Path) -> Outcome:
    """What comes of the job with blobs in a folder."""
    with FaultyFarm(tmp_path_factory.mktemp("local"), cache) as farm:
        farm.start("monitor")
        farm.start("worker")
        return outcome(farm, farm.submit(**SPEC).id)


class DistantFarm(FaultyFarm):
    """A farm that comes to its blobs over a network that can be cut; the test does, too.

    Its workers may do in the bucket what `deploy/s3/worker.json` allows, and no more; the others
    what `farm.json` does.
    """

    def __init__(self, server: S3Server, folder: Path, cache: Path) -> None:
        self.server = server
        self.network = Network(server)
        self._environment = pytest.MonkeyPatch()
        owner = server.user("owner", POLICIES / "farm.json")
        for name, value in {**owner, "AWS_ENDPOINT_URL": self.network.endpoint}.items():
            self._environment.setenv(name, value)
        self._of_workers = server.user("worker", POLICIES / "worker.json")
        super().__init__(folder, cache, f"s3://{BUCKET}/plateau")

    def start_worker(self) -> subprocess.Popen[bytes]:
        return self.start("worker", **self._of_workers)

    def __exit__(self, *error: object) -> None:
        super().__exit__(*error)
        self._environment.undo()
        self.network.__exit__(None, None, None)


@pytest.fixture(scope="module")
def farm(
    server: S3Server, tmp_path_factory: pytest.TempPathFactory, cache: Path
) -> Iterator[DistantFarm]:
    with DistantFarm(server, tmp_path_factory.mktemp("farm"), cache) as farm:
        farm.start("monitor")
        for _ in range(2):
            farm.start_worker()
        farm.wait_for_workers(2)
        yield farm


def kill(farm: DistantFarm) -> None:
    farm.server.kill()


def start(farm: DistantFarm) -> None:
    farm.server.start()


def cut(farm: DistantFarm) -> None:
    farm.network.silent = True


def heal(farm: DistantFarm) -> None:
    farm.network.silent = False


@pytest.mark.long_form
@pytest.mark.parametrize(
    ("fail", "mend"), [(kill, start), (cut, heal)], ids=lambda step: step.__name__
)
def test_a_server_that_is_away_for_longer_than_a_lease(
    farm: DistantFarm,
    undisturbed: Outcome,
    fail: Callable[[DistantFarm], None],
    mend: Callable[[DistantFarm], None],
) -> None:
    job = farm.submit(**SPEC).id
    until(lambda: farm.jobs.get(job).points >= 3)
    fail(farm)
    try:
        time.sleep(LONGER_THAN_A_LEASE_S)
        assert not farm.jobs.get(job).state.ended
    finally:
        mend(farm)
    assert_same(outcome(farm, job), undisturbed)
    assert [one for one in farm.jobs.events(job) if one.type == "trouble"] == []
    assert all(process.poll() is None for process in farm.processes)


@pytest.mark.long_form
def test_a_worker_whose_store_is_silent_stops_in_time(
    farm: DistantFarm, undisturbed: Outcome
) -> None:
    leaves = farm.start_worker()
    farm.wait_for_workers(3)
    job = farm.submit(**SPEC).id
    until(lambda: farm.jobs.get(job).points >= 1)
    farm.network.silent = True
    try:
        time.sleep(1)  # so that it has a slice whose upload is under way
        leaves.send_signal(signal.SIGTERM)
        asked = time.monotonic()
        assert leaves.wait(60) == 0
        assert time.monotonic() - asked < STOPS_WITHIN_S
        farm.processes.remove(leaves)
        until(lambda: len(Workers(farm.redis_client).living()) == 2)
    finally:
        farm.network.silent = False
    assert_same(outcome(farm, job), undisturbed)


def test_plateau_up_with_its_blobs_in_s3(
    server: S3Server, undisturbed: Outcome, tmp_path: Path
) -> None:
    where = {"PLATEAU_BLOBS": f"s3://{BUCKET}/up", "PLATEAU_THREADS": "1", **server.environment}
    up = Command("up", "--workers", "1", "--port", "0", folder=tmp_path, **where)
    try:
        url = up.wait_for(r"listens at (http://127\.0\.0\.1:\d+)")
        with Client(url) as client:
            job = client.submit(BOX, undisturbed.job.spec)
            until(lambda: client.job(job.id).finished_at is not None)
            points = [point.model_dump(exclude={"at"}) for point in client.curve(job.id)]
            assert points == undisturbed.curve
            image = decode_image(client.image(job.id, "image.exr"))
            assert image.tobytes() == undisturbed.image.tobytes()
            assert client.image(job.id, "difference.png") == undisturbed.difference
    finally:
        up.process.send_signal(signal.SIGTERM)
        assert up.exit_code() == 0
        up.end()
    # Nothing that any of it said or wrote has the secret
    assert SECRET not in up.said
    written = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert any("worker" in path.name for path in written)
    assert [path for path in written if SECRET.encode() in path.read_bytes()] == []
