"""Killed at any stage of a delivery, a monitor loses no message and makes none up."""

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
    "before the request": ("plateau.service.monitor.webhooks.requests:Requests.post", "before"),
    "between answer and note": ("plateau.farm.ledger.outbox:Outbox.settle", "before"),
    "as it has noted it": ("plateau.farm.ledger.outbox:Outbox.settle", "after"),
}
#: At these the receiver has the message already, and gets it again.
TWICE = {"between answer and note"}


@pytest.fixture(scope="module")
def hooking_farm(tmp_path_factory: pytest.TempPathFactory, cache: Path) -> Iterator[FaultyFarm]:
    folder = tmp_path_factory.mktemp("hooks")
    with FaultyFarm(folder, cache, PLATEAU_WEBHOOK_ALLOW="127.0.0.1") as farm:
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
        events = ("queued", "cancelled", "finished")
        hook = {"url": receiver.url, "secret": SECRET, "events": events}
        job = farm.submit(**{**BY_ZONES, "webhook": hook})
        farm.client.cancel(job.id)
        # Given a monitor that dies at its first message
        soon = {"plateau.service.monitor.webhooks.deliverers:_LEASE_S": 2.0}
        victim = farm.start_armed("monitor", where, when=when, constants=soon)
        farm.wait_until_ended(victim, signal.SIGKILL)
        # When another one takes over
        farm.start("monitor")
        until(
            lambda: (
                [one.state for one in farm.client.webhooks(job.id).deliveries] == ["delivered"] * 3
            ),
        )
        found = farm.client.webhooks(job.id).deliveries
        # Then each has come, some of them twice, in an order that the receiver can tell
        assert [one.event for one in found] == list(events)
        assert {one.id for one in receiver.received} == {one.id for one in found}
        assert len(receiver.received) == 3 + (stage in TWICE)
        bodies = {one.id: one.verified() for one in receiver.received}
        assert [bodies[one.id]["data"]["sequence"] for one in found] == [1, 2, 3]
        assert [bodies[one.id]["type"] for one in found] == [f"job.{one}" for one in events]
