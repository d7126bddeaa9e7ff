"""Whatever is killed while Cycles renders, the image has the bits that it has undisturbed."""

import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.faults.test_stages import MONITOR_STAGES, WORKER_STAGES
from tests.support.farms.every_time import EVERY_TIME
from tests.support.farms.faulty_farm import FaultyFarm
from tests.support.faults.invariants import Outcome, assert_same, outcome
from tests.support.until import until

#: Twelve slices, of which the monitor makes a point of the curve for every second one.
SPEC = {
    "slice_spp": 10,
    "step": 20,
    "max_spp": 120,
    "aovs": ("depth",),
    "rule": {"name": "fixed", "spp": 120},
}
#: A worker begins by loading Blender.
PATIENCE_S = 600

Submit = Callable[[], str]


@pytest.fixture(scope="module")
def whole_farm(tmp_path_factory: pytest.TempPathFactory, cache: Path) -> Iterator[FaultyFarm]:
    with FaultyFarm(tmp_path_factory.mktemp("farm"), cache) as farm:
        yield farm


@pytest.fixture
def farm(whole_farm: FaultyFarm) -> Iterator[FaultyFarm]:
    """The farm, with nothing but its API running before and after."""
    yield whole_farm
    whole_farm.stop_all()


@pytest.fixture(scope="module")
def submit(whole_farm: FaultyFarm, blend: Callable[[str], Path]) -> Submit:
    return lambda: whole_farm.submit(blend("plain"), **SPEC).id


@pytest.fixture(scope="module")
def undisturbed(whole_farm: FaultyFarm, submit: Submit) -> Outcome:
    whole_farm.start("monitor")
    whole_farm.start("worker")
    found = outcome(whole_farm, submit(), PATIENCE_S)
    whole_farm.stop_all()
    assert (found.job.variant, found.job.spp, found.job.points) == ("cycles:cpu", 120, 6)
    return found


def troubles(farm: FaultyFarm, job: str) -> list[str]:
    return [str(one.data["cause"]) for one in farm.jobs.events(job) if one.type == "trouble"]


@pytest.mark.parametrize("stage", ["while its child loads", "in mid-pass"])
def test_a_render_child_that_is_killed(
    farm: FaultyFarm, undisturbed: Outcome, submit: Submit, stage: str
) -> None:
    where, when, nth = WORKER_STAGES[stage]
    farm.start("monitor")
    job = submit()
    farm.start_armed("worker", where, when=when, time=nth, target="children")
    assert_same(outcome(farm, job, PATIENCE_S), undisturbed)
    (trouble,) = troubles(farm, job)
    assert "SIGKILL" in trouble


@pytest.mark.parametrize("stage", ["in mid-pass", "between put and commit"])
def test_a_worker_that_is_killed(
    farm: FaultyFarm, undisturbed: Outcome, submit: Submit, stage: str
) -> None:
    where, when, nth = WORKER_STAGES[stage]
    farm.start("monitor")
    job = submit()
    victim = farm.start_armed("worker", where, when=when, time=nth)
    until(lambda: victim.poll() is not None, PATIENCE_S)
    farm.wait_until_ended(victim, signal.SIGKILL)
    farm.start("worker")
    assert_same(outcome(farm, job, PATIENCE_S), undisturbed)


def test_a_monitor_that_is_killed(farm: FaultyFarm, undisturbed: Outcome, submit: Submit) -> None:
    where, when, nth = MONITOR_STAGES["in mid-checkpoint"]
    farm.start("worker")
    job = submit()
    victim = farm.start_armed("monitor", where, when=when, time=nth, constants=EVERY_TIME)
    until(lambda: victim.poll() is not None, PATIENCE_S)
    farm.wait_until_ended(victim, signal.SIGKILL)
    farm.start("monitor")
    assert_same(outcome(farm, job, PATIENCE_S), undisturbed)


def test_a_redis_that_is_killed_and_started_again(
    farm: FaultyFarm, undisturbed: Outcome, submit: Submit
) -> None:
    farm.start("monitor")
    farm.start("worker")
    job = submit()
    until(lambda: farm.jobs.get(job).points >= 2, PATIENCE_S)
    farm.redis.process.kill()
    farm.redis.process.wait()
    farm.redis.start()
    # Then nobody is blamed for what he could not renew
    assert_same(outcome(farm, job, PATIENCE_S), undisturbed)
    assert troubles(farm, job) == []
