"""Killed at any stage of its work, a process changes nothing of what the user gets."""

import itertools
import json
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from typing import Any

import httpx
import pytest

from plateau.farm.blobs import names as blobs
from tests.support.farms.every_time import EVERY_TIME
from tests.support.farms.faulty_farm import BRIEF, FaultyFarm
from tests.support.faults.invariants import Outcome, assert_same, check_job, outcome
from tests.support.long_tests import cases, rare
from tests.support.scenes.bundles import scene as scene_xml
from tests.support.until import until

Submit = Callable[[], str]

_CHILD = "plateau.worker.supervisor.child_process:RenderChild"
_OWN = "plateau.farm.ledger.ownership:Ownerships"

#: When a worker is hit: where, when, and at which call.
WORKER_STAGES = {
    "before a lease": ("plateau.farm.ledger.queue:SliceQueue.lease", "before", 3),
    "as it has a lease": ("plateau.farm.ledger.queue:SliceQueue.lease", "after", 3),
    "while its child loads": (f"{_CHILD}._ask", "after", 1),
    "in mid-pass": (f"{_CHILD}._ask", "after", 4),
    "in mid-upload": ("obstore:rename", "before", 2),
    "between put and commit": ("plateau.farm.ledger.queue:SliceQueue.commit", "before", 2),
    "as it has committed": ("plateau.farm.ledger.queue:SliceQueue.commit", "after", 2),
}

#: When a monitor is hit. Its checkpoints are made at every point of the curve.
MONITOR_STAGES = {
    "in mid-merge": ("plateau.picture.merge:Merge.add_partial", "before", 9),
    "in mid-evaluation": ("plateau.picture.judge:Judge.judge", "before", 3),
    "between judgement and point": (f"{_OWN}.append_point", "before", 4),
    "as the point is there": (f"{_OWN}.append_point", "after", 4),
    "in mid-checkpoint": (f"{_OWN}.save_checkpoint", "before", 3),
    "as the checkpoint is there": (f"{_OWN}.save_checkpoint", "after", 3),
    "between preview and showing it": (f"{_OWN}.show_results", "before", 3),
    "between verdict and withdrawal": (f"{_OWN}.end", "before", 1),
    "as the job has ended": (f"{_OWN}.end", "after", 1),
    "as it clears": ("plateau.service.monitor.job_run:JobRun._clear", "before", 1),
    "when all is cleared": (f"{_OWN}.finish", "before", 1),
    "as the job is finished": (f"{_OWN}.finish", "after", 1),
}


@pytest.fixture
def farm(shared_farm: FaultyFarm) -> Iterator[FaultyFarm]:
    """The shared farm, in which each test finds again what the one before it has kept."""
    yield shared_farm
    shared_farm.stop_all(but=shared_farm.kept)


def hit(
    farm: FaultyFarm, stage: str, signal_name: str = "SIGKILL", **more: Any
) -> subprocess.Popen[bytes]:
    """Start the process that has the stage, in which a signal arrives."""
    is_monitor = stage in MONITOR_STAGES
    where, when, nth = (WORKER_STAGES | MONITOR_STAGES)[stage]
    given = {"constants": EVERY_TIME, **more} if is_monitor else more
    role = "monitor" if is_monitor else "worker"
    return farm.start_armed(role, where, when=when, time=nth, signal_name=signal_name, **given)


@pytest.mark.parametrize(
    "stage", cases(WORKER_STAGES, ["in mid-pass", *rare("between put and commit")])
)
def test_a_worker_that_is_killed(
    farm: FaultyFarm, undisturbed: Outcome, submit: Submit, stage: str
) -> None:
    farm.keep("monitor")
    job = submit()
    victim = hit(farm, stage)
    farm.wait_until_ended(victim, signal.SIGKILL)
    farm.start("worker")
    assert_same(outcome(farm, job), undisturbed)


def _job_whose_child_is_sent(farm: FaultyFarm, submit: Submit, stage: str, signal_name: str) -> str:
    """Start a farm whose worker's render child gets this signal in this stage; return its job."""
    farm.keep("monitor")
    # With another, though it was killed a moment ago, the job would be left to that one for minutes
    until(lambda: not farm.client.workers())
    job = submit()
    hit(farm, stage, signal_name, target="children")
    return job


@pytest.mark.parametrize(
    ("stage", "signal_name"),
    cases(
        itertools.product(["while its child loads", "in mid-pass"], ["SIGKILL", "SIGSEGV"]),
        [("in mid-pass", "SIGKILL")],
    ),
)
def test_a_render_child_that_is_hit(
    farm: FaultyFarm, undisturbed: Outcome, submit: Submit, stage: str, signal_name: str
) -> None:
    job = _job_whose_child_is_sent(farm, submit, stage, signal_name)
    assert_same(outcome(farm, job), undisturbed)
    (trouble,) = (one for one in farm.jobs.events(job) if one.type == "trouble")
    assert signal_name in str(trouble.data["cause"])


@pytest.mark.parametrize(
    "stage", cases(["while its child loads", "in mid-pass"], rare("in mid-pass"))
)
def test_a_render_child_that_is_told_to_stop_renders_on(
    farm: FaultyFarm, undisturbed: Outcome, submit: Submit, stage: str
) -> None:
    """Its worker alone ends it: service managers signal every process at once."""
    job = _job_whose_child_is_sent(farm, submit, stage, "SIGTERM")
    assert_same(outcome(farm, job), undisturbed)
    assert [one for one in farm.jobs.events(job) if one.type == "trouble"] == []


@pytest.mark.long
def test_a_render_child_that_hangs(farm: FaultyFarm, undisturbed: Outcome, submit: Submit) -> None:
    watch = "plateau.worker.supervisor.child_watch"
    farm.keep("monitor")
    job = submit()
    sooner = {f"{watch}:STILL_S": 20.0, f"{watch}:_TOLD_S": 1.0}
    hit(farm, "in mid-pass", "SIGSTOP", target="children", constants=sooner)
    # Then the farm sees it while its worker lives, and takes its slice back
    until(
        lambda: any("uses no processor time" in str(one.trouble) for one in farm.client.workers())
    )
    assert_same(outcome(farm, job), undisturbed)
    (trouble,) = (one for one in farm.jobs.events(job) if one.type == "trouble")
    assert "used no processor time for 20 s while" in str(trouble.data["cause"])
    until(lambda: not any(one.trouble for one in farm.client.workers()))


@pytest.mark.parametrize(
    "stage",
    cases(["in mid-pass", "in mid-upload", "between put and commit"], ["between put and commit"]),
)
def test_a_zombie_worker_comes_back_and_commits_late(
    farm: FaultyFarm, undisturbed: Outcome, submit: Submit, stage: str
) -> None:
    farm.keep("monitor")
    job = submit()
    zombie = hit(farm, stage, "SIGSTOP")
    farm.wait_until_stopped(zombie)
    committed = farm.jobs.ledger(job).keys()
    its_own = next(index for index in itertools.count() if index not in committed)
    farm.start("worker")
    # Others go on meanwhile, its slice is theirs, and then it wakes up
    until(lambda: its_own in farm.jobs.ledger(job))
    farm.resume(zombie)
    assert_same(outcome(farm, job), undisturbed)


@pytest.mark.parametrize(
    "stage", cases(["in mid-pass", "in mid-upload", "between put and commit"], rare("in mid-pass"))
)
def test_a_worker_that_is_told_to_stop_gives_its_slice_back(
    farm: FaultyFarm, undisturbed: Outcome, submit: Submit, stage: str
) -> None:
    farm.keep("monitor")
    job = submit()
    victim = hit(farm, stage, "SIGTERM")
    farm.wait_until_ended(victim)
    # What it had is there at once, not after a lease
    farm.start("worker")
    assert_same(outcome(farm, job), undisturbed)
    assert [one for one in farm.jobs.events(job) if one.type == "trouble"] == []


@pytest.mark.long
def test_two_monitors_share_jobs_and_never_one(
    farm: FaultyFarm, undisturbed: Outcome, submit: Submit
) -> None:
    farm.keep("monitor")
    farm.start("monitor")
    farm.start("worker")
    jobs = [submit() for _ in range(3)]
    for job in jobs:
        assert_same(outcome(farm, job), undisturbed)
        check_job(farm.jobs, farm.store, farm.redis_client, job)
    assert BRIEF["max_spp"] > undisturbed.job.spp  # they were ended by the rule


@pytest.mark.parametrize(
    "stage",
    cases(
        MONITOR_STAGES,
        ["in mid-checkpoint", *rare("between verdict and withdrawal", "as it clears")],
    ),
)
def test_a_monitor_that_is_killed(
    farm: FaultyFarm, undisturbed: Outcome, submit: Submit, stage: str
) -> None:
    farm.keep("worker")
    job = submit()
    victim = hit(farm, stage)
    farm.wait_until_ended(victim, signal.SIGKILL)
    farm.start("monitor")
    assert_same(outcome(farm, job), undisturbed)


@pytest.mark.parametrize(
    "stage",
    cases(
        [
            "between judgement and point",
            "in mid-checkpoint",
            "between preview and showing it",
            "between verdict and withdrawal",
            "as it clears",
        ],
        ["between preview and showing it"],
    ),
)
def test_a_zombie_monitor_comes_back_and_can_write_nothing(
    farm: FaultyFarm, undisturbed: Outcome, submit: Submit, stage: str
) -> None:
    farm.keep("worker")
    job = submit()
    zombie = hit(farm, stage, "SIGSTOP")
    farm.wait_until_stopped(zombie)
    farm.start("monitor")
    before = outcome(farm, job)
    farm.resume(zombie)
    time.sleep(1.0)
    assert_same(before, undisturbed)
    assert_same(outcome(farm, job), undisturbed)


@pytest.mark.parametrize(
    "stage", cases(["in mid-evaluation", "in mid-checkpoint", "as it clears"], rare("as it clears"))
)
def test_a_monitor_that_is_told_to_stop_leaves_its_job_to_the_next(
    farm: FaultyFarm, undisturbed: Outcome, submit: Submit, stage: str
) -> None:
    farm.keep("worker")
    job = submit()
    victim = hit(farm, stage, "SIGTERM")
    farm.wait_until_ended(victim)
    farm.start("monitor")
    assert_same(outcome(farm, job), undisturbed)


@pytest.mark.parametrize("when", ["after", *rare("before")])
def test_a_monitor_that_is_killed_as_it_concludes_a_job_that_was_cancelled(
    farm: FaultyFarm, when: str
) -> None:
    farm.keep("worker")
    endless = {"max_spp": 100_000, "rule": {"name": "fixed", "spp": 100_000}}
    job = farm.submit(**BRIEF | endless).id
    victim = farm.start_armed("monitor", f"{_OWN}.conclude", when=when)
    until(lambda: farm.jobs.get(job).points >= 3)
    farm.client.cancel(job)
    farm.wait_until_ended(victim, signal.SIGKILL)
    farm.start("monitor")
    # Then it has the image of every sample that was rendered, in one piece
    cancelled = outcome(farm, job).job
    assert cancelled.state == "cancelled"
    assert cancelled.spp == farm.jobs.get(job).committed_spp


@pytest.mark.parametrize("when", ["before", "after"])
def test_an_api_that_is_killed_in_a_submission_makes_one_job_in_the_end(
    farm: FaultyFarm, when: str
) -> None:
    def armed(*options: str, passed: tuple[int, ...]) -> subprocess.Popen[bytes]:
        where = "plateau.farm.ledger.jobs:Jobs.create"
        return farm.start_armed(options[0], where, *options[1:], when=when, passed=passed)

    victim, url = farm.start_api(start=armed)
    request: dict[str, Any] = {
        "timeout": 60,
        "headers": {"Idempotency-Key": f"once-{when}"},
        "data": {"spec": json.dumps({"batch": when})},
    }
    scene = scene_xml().replace(b"</scene>", f"<!-- {when} --></scene>".encode())
    # Given a submission whose API dies before, or after, it has made the job
    with pytest.raises(httpx.TransportError):
        httpx.post(f"{url}/v1/jobs", files={"scene": ("s.xml", scene)}, **request)
    farm.wait_until_ended(victim, signal.SIGKILL)
    # If it is sent again, to another API
    answer = httpx.post(f"{farm.client.url}/v1/jobs", files={"scene": ("s.xml", scene)}, **request)
    assert answer.status_code == 201, answer.text
    assert answer.headers.get("Idempotency-Replayed") == ("true" if when == "after" else None)
    # Then there is one job, and it has its scene
    (job,) = farm.client.all_jobs(batch=when)
    assert job.id == answer.json()["id"]
    assert farm.store.get(blobs.scene(job.scene_sha256)) == scene
    farm.client.cancel(job.id)


@pytest.mark.long
def test_clocks_that_differ_by_minutes(
    farm: FaultyFarm, undisturbed: Outcome, submit: Submit
) -> None:
    farm.stop_all()
    farm.start_changed("monitor", clock_s=600.0)
    for clock_s in (-300.0, 300.0):
        farm.start_changed("worker", clock_s=clock_s)
    job = submit()
    found = outcome(farm, job)
    assert_same(found, undisturbed)
    # The times of a job are Redis's
    times = (found.job.created_at, found.job.started_at, found.job.ended_at, found.job.finished_at)
    assert all(times)
    assert list(times) == sorted(times)  # type: ignore[type-var]
    assert (times[-1] - times[0]).total_seconds() < 240  # type: ignore[operator]
