"""Killed at any stage of its delivery, a monitor loses no notice and makes none up."""

import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.farms.faulty_farm import BY_ZONES, FaultyFarm
from tests.support.farms.receiver import SECRET, receiving
from tests.support.long_tests import cases
from tests.support.until import until

STAGES = {
    "as it has a lease": ("plateau.farm.ledger.outbox:Outbox.take", "after"),
    "before the request": ("plateau.service.monitor.notifier.requests:Requests.post", "before"),
    "between answer and note": ("plateau.farm.ledger.outbox:Outbox.settle", "before"),
    "as it has noted it": ("plateau.farm.ledger.outbox:Outbox.settle", "after"),
}
#: At these the receiver has the message already, and gets it again.
TWICE = {"between answer and note"}


@pytest.fixture(scope="module")
def hooking_farm(tmp_path_factory: pytest.TempPathFactory, cache: Path) -> Iterator[FaultyFarm]:
    folder, allow = tmp_path_factory.mktemp("hooks"), {"PLATEAU_WEBHOOK_ALLOW": "127.0.0.1"}
    with FaultyFarm(folder, cache, **allow) as farm:
        yield farm


@pytest.fixture
def farm(hooking_farm: FaultyFarm) -> Iterator[FaultyFarm]:
    """A farm that may send to this machine, with nothing but its API running before and after."""
    yield hooking_farm
    hooking_farm.stop_all()


@pytest.mark.parametrize("stage", cases(STAGES, ["between answer and note"]))
def test_a_monitor_that_is_killed(farm: FaultyFarm, stage: str) -> None:
    where, when = STAGES[stage]
    with receiving() as receiver:
        notice = {"url": receiver.url, "secret": SECRET}
        job = farm.submit(**{**BY_ZONES, "notice": notice})
        farm.client.cancel(job.id)
        # Given a monitor that dies at its notice
        soon = {"plateau.service.monitor.notifier.notifier:_LEASE_S": 10.0}
        victim = farm.start_armed("monitor", where, when=when, constants=soon)
        farm.wait_until_ended(victim, signal.SIGKILL)
        # When another one takes over
        farm.start("monitor")
        until(lambda: [one.state for one in farm.client.job(job.id).notices] == ["delivered"])
        # Then it has come, perhaps twice, as the receiver can tell
        assert [one.id for one in receiver.received] == [f"msg_{job.id}"] * (1 + (stage in TWICE))
        for one in receiver.received:
            assert one.verified()["data"]["job"]["id"] == job.id
