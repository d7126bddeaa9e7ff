"""A farm on a Redis with TLS and users: each process can do its work, and nothing else happens."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
import redis

from plateau.client import Client
from plateau.farm.wire.views import JobView
from plateau.study.client import StudyCalls
from plateau.study.views import Screen
from tests.cluster.support_bare import (
    BareFarm,
    Certificates,
    Server,
    answers,
    certificates,
    credentials,
    server_lines,
    tls_options,
    users,
)
from tests.support.farms.real_farm import BOX
from tests.support.farms.receiver import SECRET, Receiver, receiving
from tests.support.processes.ports import free_ports
from tests.support.until import until

SIZE = {"width": 32, "height": 32}
SMALL = {"parameters": SIZE, "variant": "scalar_rgb", "step": 8, "slice_spp": 4, "max_spp": 32}
BROKEN = """<scene version="3.0.0"><integrator type="nosuch"/><sensor type="perspective">
<film type="hdrfilm"><integer name="width" value="8"/><integer name="height" value="8"/></film>
</sensor></scene>"""
LONG = SMALL | {"max_spp": 8000, "rule": {"name": "fixed"}}


@dataclass
class Place:
    """A Redis with TLS and users, and who may tell what of it."""

    server: Server
    tls: Certificates
    passwords: Path
    port: int
    root: redis.Redis

    @property
    def settings_of(self) -> Callable[[str], dict[str, str]]:
        return credentials(self.passwords, self.tls, f"rediss://localhost:{self.port}/0")


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory, tool: Callable[[str], Path]) -> Iterator[Place]:
    folder = tmp_path_factory.mktemp("bare")
    tls, (acl, passwords), port = certificates(folder / "tls"), users(folder), free_ports()[0]
    server = Server(tool("redis-server"), folder / "redis", server_lines(tls, acl, port))
    root = redis.Redis(host="localhost", port=port, **tls_options(tls))  # type: ignore[arg-type]
    yield Place(server, tls, passwords, port, answers(root))
    root.close()
    server.stop()


@pytest.fixture(scope="module")
def farm(place: Place, tmp_path_factory: pytest.TempPathFactory, cache: Path) -> Iterator[BareFarm]:
    folder = tmp_path_factory.mktemp("farm")
    allow = {"PLATEAU_WEBHOOK_ALLOW": "127.0.0.0/8", "PLATEAU_PLUGINS": "nosuch"}
    with BareFarm(folder, cache, place.root, place.settings_of, **allow) as farm:
        # The worker comes first, and waits for those who may lay out what it finds
        farm.workers(1)
        farm.start("monitor")
        made = farm.command("keys", "create", "anna", "--role", "admin")
        assert made.returncode == 0, made.stderr
        farm.client.close()
        farm.client = Client(farm.url, key=made.stdout.strip())
        yield farm


def submit(farm: BareFarm, receiver: Receiver, scene: Path = BOX, **spec: object) -> JobView:
    notice = {"url": receiver.url, "secret": SECRET}
    return farm.submit(scene, **{"notice": notice, **spec})


def test_everything_works_and_nobody_asks_for_more_than_it_may(
    farm: BareFarm, place: Place, tmp_path: Path
) -> None:
    client = farm.client
    broken_scene = tmp_path / "broken.xml"
    broken_scene.write_text(BROKEN)
    with receiving() as receiver:
        # A job to its end, with its slices kept; it waits while it is paused
        job = submit(farm, receiver, **SMALL, keep_slices=True, batch="walk")
        done = client.wait(job.id, timeout_s=300)
        assert done.state in {"converged", "exhausted"}, done.reason
        assert len(client.image(job.id, "image.exr")) > 1000
        assert [event.type for event in client.events(job.id)][-1] == "finished"
        # Another that is paused, goes on, is put forward and cancelled
        long = submit(farm, receiver, **LONG, batch="walk")
        until(lambda: client.job(long.id).committed_spp >= 16)
        client.pause(long.id)
        client.resume(long.id)
        client.set_priority(long.id, 3)
        client.cancel(long.id)
        # One that goes on with the first, and one that cannot be rendered
        client.wait(client.again(job.id, max_spp=48).id, timeout_s=300)
        broken = submit(farm, receiver, scene=broken_scene, **SMALL | {"parameters": {}})
        assert client.wait(broken.id, timeout_s=300).state == "failed"
        assert [view.name for view in client.all_batches()] == ["walk"]
        # A study of it, answered
        study = StudyCalls(client).create(job.id, levels=[4, 8])
        screen = Screen(viewing_distance_cm=60.0, pixel_pitch_mm=0.25)
        StudyCalls(client).take_part(study.id, "o-1", screen)
        StudyCalls(client).answer(study.id, "o-1", 1, seen=True, seconds=1.0)
        StudyCalls(client).delete(study.id)
        # And all that people look at and do by hand
        receiver.wait_for(3)
        assert client.job(job.id).notices
        assert len(client.workers()) == len(client.scenes()) - 1 == 1
        assert list(client.all_jobs())
        for command in (
            ("keys", "list"),
            ("gc", "--dry-run"),
            ("gc", "--results-older-than", "0", "--scenes-unused-for", "0"),
        ):
            ran = farm.command(*command)
            assert ran.returncode == 0, (command, ran.stderr)
    # Then nobody was refused anything, and nobody's password was ever said
    assert place.root.acl_log() == []
    said = farm.logs()
    for file in place.passwords.iterdir():
        assert file.read_text().strip() not in said
    assert SECRET not in said


def test_a_password_is_told_to_nobody(farm: BareFarm, place: Place, tmp_path: Path) -> None:
    right = (place.passwords / "plateau-admin.password").read_text().strip()
    wrong = tmp_path / "wrong"
    wrong.write_text("guessed\n")
    url = f"plateau-admin:{right}@localhost:{place.port}"
    cases = {
        "invalid username-password": {"PLATEAU_REDIS_PASSWORD_FILE": str(wrong)},
        "certificate verify failed": {"PLATEAU_REDIS_CA": str(place.tls.client[0])},
        "cannot be reached": {"PLATEAU_REDIS_CERT": "", "PLATEAU_REDIS_KEY": ""},
        "cannot be read": {"PLATEAU_REDIS_URL": f"rediss://{url}none"},
    }
    for why, changed in cases.items():
        ran = farm.command("keys", "list", **changed)
        told = ran.stdout + ran.stderr
        assert ran.returncode == 1, (why, told)
        assert why in told, told
        assert right not in told
        assert "guessed" not in told
    # And where all is well, whoever asks about the machine is told of the Redis, and not of that
    ran = farm.command("doctor")
    assert ran.returncode == 0, ran.stdout
    assert "ok  Redis user: plateau-admin\n" in ran.stdout
    assert "ok  Redis over TLS: yes\n" in ran.stdout
    assert "ok  Redis persistence: appendonly yes, appendfsync always\n" in ran.stdout
    assert right not in ran.stdout + ran.stderr
    place.root.acl_log_reset()


def test_what_was_answered_outlives_a_kill(farm: BareFarm, place: Place) -> None:
    # Given a job under way
    job = farm.submit(BOX, **LONG)
    until(lambda: farm.client.job(job.id).committed_spp >= 16)
    # When Redis is killed and started again, users and all
    place.server.kill()
    place.server.start()
    answers(place.root)
    # Then the job goes on
    seen = farm.client.job(job.id).committed_spp
    until(lambda: farm.client.job(job.id).committed_spp > seen + 16)
    farm.client.cancel(job.id)
