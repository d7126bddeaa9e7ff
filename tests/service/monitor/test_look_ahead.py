"""Workers are kept busy, but near its end a job is not rendered beyond it."""

from pathlib import Path

import pytest
import redis

from plateau.farm.ledger.queue import SliceQueue
from plateau.farm.ledger.workers import Workers
from plateau.farm.model.fit import Crew
from plateau.farm.model.job import Job
from plateau.farm.model.slices.plan import Plan
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.states import JobState
from plateau.service.monitor import steps
from plateau.service.monitor.decisions import next_step
from plateau.service.monitor.look_ahead import SPARE, LookAhead, enough
from tests.service.monitor.decided_job import DecidedJob, DecidingMonitor, Rules, made_job
from tests.support.farms.ledger_farm import about
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.until import until

#: Keeps sixteen workers busy.
ENOUGH = 33
PLAN = Plan.of(JobSpec(max_spp=2000, allocation="frame"))


def job(rule: str = "visible", points: int = 1, **fields: object) -> Job:
    return made_job(spec={"rule": {"name": rule}, "max_spp": 2000}, points=points, **fields)


def ahead(expected_spp: int | None) -> LookAhead:
    return LookAhead.of(job()).expecting(expected_spp)


@pytest.mark.parametrize(
    ("expected_spp", "merged", "enough", "stop"),
    [
        # Far from its end no worker waits, and nothing is planned beyond the cap
        (None, 20, ENOUGH, 53),
        (1900, 20, ENOUGH, 53),
        (10_000, 20, ENOUGH, 53),
        (None, 70, ENOUGH, 80),
        # Near it they end with the evaluation that may end the job
        (601, 24, ENOUGH, 28),
        (700, 24, ENOUGH, 28),
        (701, 24, ENOUGH, 32),
        (600, 24, ENOUGH, 28),  # it was expected to end just now: at the next one then
        (300, 24, ENOUGH, 28),
        (600, 21, ENOUGH, 24),
        (600, 23, ENOUGH, 24),
        # A long job has two to spare after the evaluation at 1,600 spp, for as many workers
        (1550, 60, ENOUGH, 66),
        (1550, 60, 3, 63),
    ],
)
def test_slices_are_planned_up_to(
    expected_spp: int | None, merged: int, enough: int, stop: int
) -> None:
    assert ahead(expected_spp).stop(PLAN, merged, enough) == stop


@pytest.mark.parametrize(
    ("expected_spp", "end_spp"), [(None, 1000), (1200, 1200), (300, 500), (9000, 2000)]
)
def test_the_end_is_behind_what_is_merged_and_not_behind_the_cap(
    expected_spp: int | None, end_spp: int
) -> None:
    assert ahead(expected_spp).expected_end_spp(500) == end_spp


def test_only_workers_count_that_may_render_the_job(client: redis.Redis) -> None:
    gpu = {"pool": "night", "tags": ["gpu"]}
    for name, more in (("a", {}), ("b", {}), ("c", gpu), ("d", {"trouble": "the disk is full"})):
        SliceQueue(client, name, 60).heartbeat({**about(name), **more}, ())
    crew = Crew(Workers(client).living(within_s=600))
    made = job()

    def ahead_of(**changes: object) -> int:
        spec = made.spec.model_copy(update=changes)
        return enough(crew.fitting(made.model_copy(update={"spec": spec})))

    assert ahead_of() == 5
    assert ahead_of(pool="night") == ahead_of(pool="night", requires=("gpu",)) == 3
    assert ahead_of(requires=("gpu",)) == 3  # nobody, and yet the first that comes has work
    assert ahead_of(variant="cuda_ad_rgb") == 3


def test_before_its_first_point_a_job_may_end_at_its_second() -> None:
    assert LookAhead.of(job(points=0)).stop(PLAN, 0, ENOUGH) == 8
    # But a rule that needs more evaluations cannot
    assert LookAhead.of(job("reverse", points=0)).stop(PLAN, 0, ENOUGH) == 33


def furthest(made: DecidedJob, *, is_slow: bool) -> int:
    """The most that is planned beyond the sums, until the job is finished."""
    monitor, seen = DecidingMonitor(made, 3), 0

    def meanwhile(_: int) -> None:
        nonlocal seen
        seen = max(seen, made.planned - monitor.sums)
        if is_slow and isinstance(next_step(monitor.known), steps.MergeSlice | steps.JudgeImage):
            for _ in range(100):  # all that is planned
                made.commit(0)

    while not made.finished:
        monitor.turn(meanwhile=meanwhile)
        made.commit(0)
    return seen


@pytest.mark.parametrize(("is_slow", "most"), [(False, 3), (True, 8 * 3)])
def test_a_monitor_that_is_slower_than_its_workers_plans_further_ahead(
    is_slow: bool, most: int
) -> None:
    spec = JobSpec(max_spp=5000, allocation="frame", rule="reverse")
    assert furthest(DecidedJob(spec, Rules()), is_slow=is_slow) == most
    # But not beyond the end that it expects
    made = DecidedJob(spec, Rules(stop_spp=500, expected=lambda _: 500))
    furthest(made, is_slow=is_slow)
    assert made.planned == 500 // spec.slice_spp


def test_a_monitor_that_takes_over_knows_what_was_forecast() -> None:
    assert LookAhead.of(job(expected_spp=650)).stop(PLAN, 24, ENOUGH) == 28


@pytest.mark.parametrize(
    "rule",
    [{"name": "visible", "target": 0.05}, {"name": "reverse"}, {"name": "successive"}],
    ids=lambda rule: rule["name"],
)
def test_a_job_of_many_workers_is_not_rendered_far_beyond_its_end(
    client: redis.Redis, redis_url: str, tmp_path: Path, rule: dict[str, object]
) -> None:
    farm = NoiseFarm(client, redis_url, tmp_path, sigma=0.6)
    for number in range(16):
        SliceQueue(client, f"worker-{number}", 60).heartbeat(about(f"worker-{number}"), ())
    found = farm.submit(rule=rule, max_spp=10_000)
    with farm.monitor():
        # Whatever is planned is rendered at once
        while not (ended := farm.jobs.get(found.id)).state.ended:
            lease = farm.lease()
            if lease is not None:
                farm.commit(lease)
        until(lambda: farm.jobs.get(found.id).finished_at is not None)
    assert ended.state is JobState.CONVERGED
    assert ended.spp > 300
    # However slow the monitor is beside them, no more is planned ahead than is merged, nor more
    # than a few beyond the point at which the job was expected to end
    step, curve = found.spec.step, farm.jobs.curve(found.id)
    merged = [(min(point.spp + step, ended.spp), point.expected_spp) for point in curve]
    assert ended.committed_spp <= max(
        min(2 * spp, max(expected or 2 * spp, spp) + step + SPARE * spp) for spp, expected in merged
    )
