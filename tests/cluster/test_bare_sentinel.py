"""A Redis that is watched by sentinels: its master dies in mid-job, and nothing is different."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
import redis

from plateau.farm.redis.link import connect
from tests.cluster.support_bare import (
    DEPLOY,
    ROOT,
    ROOT_PASSWORD,
    BareFarm,
    Server,
    answers,
    certificates,
    credentials,
    server_lines,
    tls_lines,
    tls_options,
    users,
)
from tests.support.farms.real_farm import BOX
from tests.support.processes.ports import free_ports
from tests.support.until import until

NAME = "plateau"
SENTINEL_PASSWORD = "of-the-sentinels"
SPEC = {
    "parameters": {"width": 32, "height": 32},
    "variant": "scalar_rgb",
    "step": 16,
    "slice_spp": 4,
    "max_spp": 400,
    "rule": {"name": "fixed"},
}


class Watched:
    """A master, two replicas, and three sentinels that promote one of these when it dies.

    One replica would do for the failover, but the new master takes no write that none follows.
    """

    def __init__(self, folder: Path, tool: Callable[[str], Path]) -> None:
        self.tls = certificates(folder / "tls")
        acl, self.passwords = users(folder)
        self.ports = free_ports(3)
        self.servers = {
            port: Server(
                tool("redis-server"),
                folder / f"redis-{port}",
                [
                    *server_lines(self.tls, acl, port),
                    f"include {DEPLOY / 'replica.conf'}",
                    f"masterauth {self._password('replica')}",
                    "repl-diskless-sync-delay 0",
                    *([f"replicaof 127.0.0.1 {self.ports[0]}"] if port != self.ports[0] else []),
                ],
            )
            for port in self.ports
        }
        for port in self.ports:
            answers(self.client(port))
        self.sentinels = free_ports(3)
        self._watchers = [
            Server(
                tool("redis-sentinel"),
                folder / f"sentinel-{port}",
                [
                    *tls_lines(self.tls),
                    f"requirepass {SENTINEL_PASSWORD}",
                    *self._deployed(port),
                    f"sentinel sentinel-pass {SENTINEL_PASSWORD}",
                    f"sentinel auth-pass {NAME} {self._password('sentinel')}",
                ],
                "--sentinel",
            )
            for port in self.sentinels
        ]

    def _deployed(self, port: int) -> list[str]:
        """The sentinel's configuration as it is deployed, but for addresses and patience."""
        text = (DEPLOY / "sentinel.conf").read_text()
        for there, here in (
            ("tls-port 26379", f"tls-port {port}"),
            (f"{NAME} 10.0.0.1 6379", f"{NAME} 127.0.0.1 {self.ports[0]}"),
            (f"down-after-milliseconds {NAME} 5000", f"down-after-milliseconds {NAME} 1500"),
        ):
            assert there in text
            text = text.replace(there, here)
        return text.splitlines()

    def _password(self, role: str) -> str:
        return (self.passwords / f"plateau-{role}.password").read_text().strip()

    def client(self, port: int) -> redis.Redis:
        """The test's own client of one server."""
        return redis.Redis(host="localhost", port=port, **tls_options(self.tls))  # type: ignore[arg-type]

    @property
    def address(self) -> str:
        """The URL without a user."""
        hosts = ",".join(f"localhost:{port}" for port in self.sentinels)
        return f"rediss+sentinel://{hosts}/{NAME}/0"

    def url(self, user: str, password: str) -> str:
        """The URL with all in it."""
        tls = f"ssl_ca_certs={self.tls.ca}&ssl_certfile={self.tls.client[0]}"
        whole = f"{tls}&ssl_keyfile={self.tls.client[1]}&sentinel_password={SENTINEL_PASSWORD}"
        return f"{self.address.replace('://', f'://{user}:{password}@', 1)}?{whole}"

    def master(self) -> int:
        """The port of the master, by what most sentinels say."""
        said = [self._asked(port) for port in self.sentinels]
        return max(set(said), key=said.count)

    def _sentinel(self, port: int) -> redis.Redis:
        options = tls_options(self.tls) | {"username": None, "password": SENTINEL_PASSWORD}
        return redis.Redis(host="localhost", port=port, **options)  # type: ignore[arg-type]

    def _asked(self, port: int) -> int:
        with self._sentinel(port) as one:
            found = one.execute_command("SENTINEL", "GET-MASTER-ADDR-BY-NAME", NAME)
        return int(found[1])

    def is_ready(self) -> bool:
        """Whether every replica follows, and every sentinel knows the others and the replicas."""
        with self.client(self.ports[0]) as master:
            following = master.info("replication")["connected_slaves"]
        return following == len(self.ports) - 1 and all(map(self._is_informed, self.sentinels))

    def _is_informed(self, port: int) -> bool:
        with self._sentinel(port) as one:
            known = one.sentinel_master(NAME)
        return bool(
            known["num-other-sentinels"] == 2 and known["num-slaves"] == len(self.ports) - 1
        )

    def stop(self) -> None:
        """End all of them."""
        for one in (*self._watchers, *self.servers.values()):
            one.stop()


@pytest.fixture(scope="module")
def watched(
    tmp_path_factory: pytest.TempPathFactory, tool: Callable[[str], Path]
) -> Iterator[Watched]:
    with ExitStack() as stack:
        found = Watched(tmp_path_factory.mktemp("s"), tool)
        stack.callback(found.stop)
        until(found.is_ready)
        yield found


@pytest.fixture(scope="module")
def farm(
    watched: Watched, tmp_path_factory: pytest.TempPathFactory, cache: Path
) -> Iterator[BareFarm]:
    folder = tmp_path_factory.mktemp("farm")
    secret = folder / "sentinels"
    secret.write_text(SENTINEL_PASSWORD)
    own = {"PLATEAU_REDIS_SENTINEL_PASSWORD_FILE": str(secret)}
    root = connect(watched.url(ROOT, ROOT_PASSWORD))
    settings_of = credentials(watched.passwords, watched.tls, watched.address)
    with BareFarm(folder, cache, root, settings_of, **own) as farm:
        farm.start("monitor")
        farm.workers(2)
        yield farm


def test_a_failover_in_mid_job_changes_nothing(farm: BareFarm, watched: Watched) -> None:
    # Given what a job comes to that nothing happens to
    undisturbed = farm.client.wait(farm.submit(BOX, **SPEC).id, timeout_s=300)
    assert undisturbed.state == "exhausted"
    # And another, in the middle of its work
    job = farm.submit(BOX, **SPEC)
    until(lambda: farm.client.job(job.id).committed_spp >= 60)
    # When the master dies
    before = watched.master()
    watched.servers[before].kill()
    until(lambda: watched.master() != before)
    assert farm.client.job(job.id).state in {"rendering", "exhausted"}
    # Then the job is ended by those who were at it, with the same curve and the same pixels
    done = farm.client.wait(job.id, timeout_s=300)
    assert (done.state, done.spp) == (undisturbed.state, undisturbed.spp)
    assert farm.curve(done) == farm.curve(undisturbed)
    assert farm.image(done).tobytes() == farm.image(undisturbed).tobytes()
    indices = [part.index for part in farm.client.slices(job.id)]
    assert indices == list(range(len(indices)))
    # And when it comes back, it follows, and is master when the other goes
    watched.servers[before].start()
    with answers(watched.client(before)) as old:
        until(lambda: old.info("replication").get("master_link_status") == "up")
    assert farm.client.job(undisturbed.id).state == "exhausted"
    assert SENTINEL_PASSWORD not in farm.logs()
