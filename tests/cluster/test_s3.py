"""Blobs in S3, on real servers: what every store must do, and what only one on a network meets."""

import io
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import trustme

from plateau.farm.blobs.names import MARK
from plateau.farm.blobs.store import Blobs
from plateau.farm.model.errors import BlobsUnavailable
from tests.cluster.support_s3 import BUCKET, SECRET, Network, S3Server
from tests.support.blob_contract import BIG, BlobContract
from tests.support.until import until

SERVERS = ["versitygw", pytest.param("minio", marks=pytest.mark.long_form)]
POLICIES = Path(__file__).parents[2] / "deploy" / "s3"


@pytest.fixture(scope="module", params=SERVERS)
def server(
    request: pytest.FixtureRequest,
    tool: Callable[[str], Path],
    tmp_path_factory: pytest.TempPathFactory,
) -> Iterator[S3Server]:
    with S3Server(tool(request.param), tmp_path_factory.mktemp(request.param)) as server:
        yield server


@pytest.fixture
def environment(server: S3Server, monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    for name, value in server.environment.items():
        monkeypatch.setenv(name, value)
    return monkeypatch


@pytest.fixture
def store(environment: pytest.MonkeyPatch, tmp_path: Path) -> Blobs:
    return Blobs(f"s3://{BUCKET}/{tmp_path.name}")


class TestABucket(BlobContract):
    """Does what every store must do."""


def test_a_listing_has_many_pages(store: Blobs, form: str) -> None:
    names = {f"jobs/j/previews/{spp:07d}.png" for spp in range(30 if form == "short" else 1100)}
    for name in names:
        store.put(name, b"x")
    assert set(store.names("jobs/")) == names
    store.delete(*names)
    assert store.names("") == []


RACER = """
import sys
from plateau.farm.blobs.store import Blobs
store = Blobs(sys.argv[1])
store.names("")
print("ready", flush=True)
sys.stdin.readline()
mine = sys.argv[2].encode()
print(*[int(store.create(f"race/{round}", mine)) for round in range(int(sys.argv[3]))])
"""


def test_of_several_processes_that_create_a_blob_one_does(store: Blobs, form: str) -> None:
    rounds = 20 if form == "short" else 200
    racers = [
        subprocess.Popen(
            [sys.executable, "-c", RACER, store.where, f"racer {number}", str(rounds)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        for number in range(4)
    ]
    for racer in racers:
        assert racer.stdout is not None
        assert racer.stdout.readline() == "ready\n"
    for racer in racers:
        assert racer.stdin is not None
        racer.stdin.write("go\n")
        racer.stdin.flush()
    done = [racer.communicate(timeout=120)[0].split() for racer in racers]
    for round_, of_round in enumerate(zip(*done, strict=True)):
        assert of_round.count("1") == 1, round_
        assert store.get(f"race/{round_}") == b"racer %d" % of_round.index("1")


class Slow(io.BytesIO):
    """A file whose second half comes when it is told to."""

    def __init__(self, content: bytes) -> None:
        super().__init__(content)
        self.reached = threading.Event()
        self.go_on = threading.Event()

    def read(self, size: int | None = -1) -> bytes:
        if self.tell() >= len(self.getvalue()) // 2:
            self.reached.set()
            self.go_on.wait(60)
        return super().read(size)


def test_a_server_that_is_killed_in_the_middle_of_a_put(store: Blobs, server: S3Server) -> None:
    store.put("scenes/before", b"x")
    content, failed = Slow(BIG * 2), []

    def put() -> None:
        try:
            store.put("scenes/big", content)
        except BlobsUnavailable as error:
            failed.append(str(error))

    putting = threading.Thread(target=put)
    putting.start()
    assert content.reached.wait(60)
    server.kill()
    content.go_on.set()
    putting.join(60)
    assert len(failed) == 1
    with pytest.raises(BlobsUnavailable):
        store.get("scenes/before")
    # When it is there again, nothing is half done, and what failed can be done again
    server.start()
    until(lambda: _answers(store))
    assert store.names("") == ["scenes/before"]
    assert not store.exists("scenes/big")
    store.put("scenes/big", BIG * 2)
    assert store.get("scenes/big") == BIG * 2


def test_a_process_that_is_killed_in_the_middle_of_a_put(store: Blobs) -> None:
    program = (
        "import io, sys, time; from plateau.farm.blobs.store import Blobs\n"
        "class Slow(io.BytesIO):\n"
        "    def read(self, size=-1):\n"
        "        if self.tell() > 12_000_000:\n"
        "            print('half', flush=True); time.sleep(60)\n"
        "        return super().read(size)\n"
        "Blobs(sys.argv[1]).put('jobs/j/image.exr', Slow(bytes(20_000_000)))"
    )
    putting = subprocess.Popen(
        [sys.executable, "-c", program, store.where], stdout=subprocess.PIPE, text=True
    )
    assert putting.stdout is not None
    assert putting.stdout.readline() == "half\n"
    putting.kill()
    putting.wait()
    putting.stdout.close()
    assert store.names("") == []
    assert not store.exists("jobs/j/image.exr")
    store.put("jobs/j/image.exr", b"whole")
    assert store.names("") == ["jobs/j/image.exr"]


class TestAnAnswerThatWasLost:
    """Says nothing: it is asked again. tests/farm/blobs/test_bucket.py has what is created once."""

    @pytest.fixture
    def network(self, server: S3Server, environment: pytest.MonkeyPatch) -> Iterator[Network]:
        with Network(server) as network:
            environment.setenv("AWS_ENDPOINT_URL", network.endpoint)
            yield network

    @pytest.fixture
    def distant(self, network: Network, tmp_path: Path) -> Blobs:
        return Blobs(f"s3://{BUCKET}/{tmp_path.name}")

    def test_to_who_puts_or_removes_any_other_blob(self, network: Network, distant: Blobs) -> None:
        network.lose("PUT ", 2)
        distant.put("jobs/j/a", b"x")
        network.lose("POST ", 2)
        distant.delete("jobs/j/a")
        assert network.lost == 2
        assert distant.names("") == []

    def test_in_the_middle_of_what_is_read(
        self, network: Network, distant: Blobs, server: S3Server
    ) -> None:
        distant.put("scenes/a", BIG)
        network.lose("GET ", 2)
        assert distant.get("scenes/a") == BIG
        assert network.lost == 2


def test_wrong_credentials_and_a_missing_bucket_are_clear_errors(
    server: S3Server, environment: pytest.MonkeyPatch
) -> None:
    def refusal(url: str) -> str:
        with pytest.raises(BlobsUnavailable) as refused:
            Blobs(url).names("")
        with pytest.raises(BlobsUnavailable):
            Blobs(url).exists("scenes/a")  # which is not to say that it is missing
        assert SECRET not in str(refused.value)
        assert "\n" not in str(refused.value)
        return str(refused.value)

    assert "there is no such bucket" in refusal("s3://nobodys")
    environment.setenv("AWS_SECRET_ACCESS_KEY", f"not the {SECRET}")
    assert "AWS_SECRET_ACCESS_KEY is not that of AWS_ACCESS_KEY_ID" in refusal(f"s3://{BUCKET}")
    environment.setenv("AWS_ACCESS_KEY_ID", "nobody")
    assert "the store does not know this AWS_ACCESS_KEY_ID" in refusal(f"s3://{BUCKET}")


def test_a_worker_s_credentials_are_of_no_use_for_anything_else(
    tool: Callable[[str], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """That they are enough for a worker is shown by those of test_s3_farm.py."""
    with S3Server(tool("versitygw"), tmp_path) as server:
        for name, value in server.environment.items():
            monkeypatch.setenv(name, value)
        store = Blobs(f"s3://{BUCKET}/plateau")
        store.make_mark("ours")
        result, partial = "jobs/j/results/1/image.exr", "jobs/j/partials/000000-w-1.exr"
        for name in ("scenes/a", result, "elsewhere/a"):
            store.put(name, b"x")
        Blobs(f"s3://{BUCKET}").put("scenes/of-others", b"x")
        for name, value in server.user("worker", POLICIES / "worker.json").items():
            monkeypatch.setenv(name, value)
        theirs = Blobs(store.where)
        assert theirs.mark() == "ours"
        assert theirs.get("scenes/a") == b"x"
        assert not theirs.exists("scenes/b")
        theirs.put(partial, BIG)
        for ask in (
            lambda: theirs.get(result),
            lambda: theirs.put(result, b"y"),
            lambda: theirs.delete(result),
            lambda: theirs.put("scenes/a", b"y"),
            lambda: theirs.delete("scenes/a"),
            lambda: theirs.put(MARK, b"y"),
            lambda: theirs.delete(MARK),
            lambda: theirs.put("elsewhere/a", b"y"),
            lambda: Blobs(f"s3://{BUCKET}").get("scenes/of-others"),
        ):
            with pytest.raises(BlobsUnavailable, match="the store does not allow that"):
                ask()
        theirs.delete(partial)
        assert store.mark() == "ours"
        assert sorted(store.names("")) == ["elsewhere/a", result, "scenes/a"]
        assert store.get("scenes/a") == store.get(result) == b"x"


def test_a_server_with_tls_of_an_authority_of_its_own(
    tool: Callable[[str], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    authority = trustme.CA()
    ours = authority.issue_cert("127.0.0.1")
    ours.cert_chain_pems[0].write_to_path(tmp_path / "certificate.pem")
    ours.private_key_pem.write_to_path(tmp_path / "key.pem")
    authority.cert_pem.write_to_path(tmp_path / "authority.pem")
    certificate = (tmp_path / "certificate.pem", tmp_path / "key.pem")
    with S3Server(tool("versitygw"), tmp_path, *certificate) as server:
        for name, value in server.environment.items():
            monkeypatch.setenv(name, value)
        with pytest.raises(BlobsUnavailable, match="set AWS_CA_BUNDLE"):
            Blobs(f"s3://{BUCKET}").names("")
        monkeypatch.setenv("AWS_CA_BUNDLE", str(tmp_path / "authority.pem"))
        store = Blobs(f"s3://{BUCKET}")
        store.put("a", BIG)
        assert store.get("a") == BIG


def _answers(store: Blobs) -> bool:
    try:
        store.names("")
    except BlobsUnavailable:
        return False
    return True
