"""The operator is told of troubles, of each once until it is over."""

import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import redis

from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger import troubles
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.queue import SliceQueue
from plateau.farm.model.errors import StoreUnavailable
from plateau.farm.model.spec import JobSpec
from plateau.farm.process.settings import Settings
from plateau.farm.redis import keys
from plateau.farm.redis.link import connect
from plateau.service.monitor.notifier import troubles as module
from plateau.service.monitor.notifier.troubles import Teller, telling_troubles
from plateau.service.notices.targets import BadTargets, Targets, read_targets
from tests.service.monitor.notifier.test_notes import by_json, told
from tests.support.farms.ledger_farm import about, live_on
from tests.support.farms.receiver import OK, Receiver, receiving
from tests.support.threads import working
from tests.support.until import until


@pytest.fixture
def told_ops() -> Iterator[tuple[Receiver, Targets]]:
    with receiving() as receiver:
        yield receiver, Targets({"ops": by_json(receiver.url)}, troubles=("ops",))


def texts(receiver: Receiver) -> list[str]:
    return [note["message"] for note in told(receiver)]


def lives(client: redis.Redis, name: str = "noise", **more: Any) -> None:
    described = {**about(name), "variants": ("scalar_rgb",), **more}
    SliceQueue(client, name, 60).heartbeat(described, ())
    live_on(client, name)


def test_each_trouble_is_told_once_until_it_is_over(
    client: redis.Redis, store: Blobs, told_ops: tuple[Receiver, Targets]
) -> None:
    box, targets = told_ops
    teller = Teller(client, store, targets, 0.0, "https://farm/")
    lives(client)
    teller.check()
    assert box.received == []
    # Given jobs that no worker can render
    jobs = Jobs(client)
    made = [
        jobs.create(JobSpec(requires=("gpu",)), name="box", scene_sha256="00").job for _ in range(2)
    ]
    for _ in range(3):
        teller.check()
    [words] = texts(box)
    assert f"job box ({made[0].id}) waits for a worker with tags gpu" in words
    assert "it is one of 2" in words
    assert f"https://farm/jobs/{made[0].id}" in words
    assert told(box)[0]["title"] == "Plateau: a trouble"
    # Once such a worker lives it is over, and the same trouble is news again
    lives(client, "noise-2", tags=("gpu",))
    teller.check()
    lives(client, "noise-2", tags=("gpu",), trouble="it has no variant")
    teller.check()
    teller.check()
    words = "\n".join(texts(box)[1:])
    assert len(box.received) == 3
    assert "worker noise-2 takes no work: it has no variant" in words
    assert "waits for a worker with tags gpu" in words


def test_a_store_that_takes_nothing_is_told_by_the_machine_that_sees_it(
    client: redis.Redis,
    store: Blobs,
    told_ops: tuple[Receiver, Targets],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    box, targets = told_ops
    teller = Teller(client, store, targets, 0.0)
    teller.check()
    assert store.names("") == []  # its probe is gone
    # Given a disk on which nothing can be written
    folder = tmp_path / "blobs"
    folder.rename(tmp_path / "away")
    folder.write_text("no folder")
    teller.check()
    # Another machine, which sees no trouble, does not end this one's
    monkeypatch.setattr(troubles.socket, "gethostname", lambda: "elsewhere")
    Teller(client, Blobs(str(tmp_path / "away")), targets, 0.0).check()
    monkeypatch.undo()
    teller.check()
    [words] = texts(box)
    assert "cannot write into the blob store" in words
    # When it is over
    folder.unlink()
    (tmp_path / "away").rename(folder)
    teller.check()
    assert client.hlen(keys.TROUBLES) == 0


def test_it_must_last_and_is_told_again_where_that_failed(
    client: redis.Redis, store: Blobs
) -> None:
    Jobs(client).create(JobSpec(), name="box", scene_sha256="00")
    answers = lambda number, _: (500, {}) if number < 2 else OK  # noqa: E731
    with receiving(answers) as receiver:
        targets = Targets({"ops": by_json(receiver.url)}, troubles=("ops",))
        Teller(client, store, targets, 60.0).check()
        assert receiver.received == []
        one, other = (Teller(client, store, targets, 0.0, lease_s=60) for _ in range(2))
        one.check()
        # While one monitor may still tell it, another does not
        other.check()
        assert len(receiver.received) == 1
        late = Teller(client, store, targets, 0.0, lease_s=0.0)
        client.delete(keys.TROUBLES)
        late.check()
        late.check()
        assert len(receiver.received) == 2
    assert b"there is none that takes work" in receiver.received[1].body


def test_without_redis_each_monitor_tells_by_its_own_memory(
    client: redis.Redis,
    store: Blobs,
    told_ops: tuple[Receiver, Targets],
    monkeypatch: pytest.MonkeyPatch,
    redis_url: str,
    tmp_path: Path,
) -> None:
    box, targets = told_ops
    gone = connect("redis://127.0.0.1:1/0")
    teller, over = Teller(gone, store, targets, 0.0, poll_s=0.01), threading.Event()
    with working(lambda: teller.run(over), over.set):
        until(lambda: box.received)
        with pytest.raises(StoreUnavailable):
            teller.check()
    assert "Redis cannot be used" in texts(box)[0]
    assert len(box.received) == 1
    # And a monitor does so by its settings
    monkeypatch.setattr(module, "_POLL_S", 0.01)
    monkeypatch.setattr(module, "_PATIENCE_S", 0.0)
    file = tmp_path / "targets"
    file.write_text(f"ops {targets.urls['ops']}\n")
    settings = Settings(redis_url=redis_url, notify_file=file, notify_troubles="ops")
    Jobs(client).create(JobSpec(pool="night"), name="box", scene_sha256="00")
    with telling_troubles(settings, store, read_targets(settings)):
        until(lambda: len(box.received) == 2)
    assert "waits for a worker in pool night" in texts(box)[1]
    with pytest.raises(BadTargets, match="PLATEAU_NOTIFY_TROUBLES: there is no target 'lead'"):
        read_targets(Settings(notify_file=file, notify_troubles="lead"))
