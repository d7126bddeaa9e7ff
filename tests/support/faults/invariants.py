"""Every invariant of a finished job, checked from outside: by API, Redis and blob store."""

from collections.abc import Collection, Set
from dataclasses import dataclass
from hashlib import sha256
from itertools import pairwise

import redis

from plateau.farm.blobs import names as blobs
from plateau.farm.blobs.store import Blobs
from plateau.farm.images.exr import Pixels
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.ownership import Checkpoint
from plateau.farm.model.slices.plan import Plan
from plateau.farm.model.states import JOB_MOVES, JobState
from plateau.farm.redis import keys
from plateau.farm.wire.views import JobView
from plateau.metric.non_finite import allowed_non_finite
from plateau.picture.previews import MOST as MOST_PREVIEWS
from tests.support.farms.real_farm import Farm
from tests.support.until import until

#: The files of any job that has an image.
RESULTS = ("image.exr", "image.png", "thumbnail.png")

#: What Redis keeps of a job that is finished.
KEPT = {"", "ledger", "rounds", "seeds", "curve", "events", "log", "digests", "sealed", "shot"}

#: Keys that Redis has where there is no job.
_OF_THE_FARM = {
    *(keys.SCHEMA, keys.STORE, keys.SCENES, keys.SCENES_USED),
    *(keys.HEARD, keys.TOTALS, keys.MONITORS),
    *(keys.WORKERS, keys.API_KEYS, keys.API_KEYS_USED),
}
#: And those of a day, of an hour, and until somebody is woken.
_FOR_A_WHILE = (
    *("plateau:idempotency:", keys.monitor(""), keys.worker("")),
    *("plateau:told:", keys.IDLE),
)


@dataclass(frozen=True)
class Outcome:
    """What a user has of a job in the end."""

    job: JobView
    curve: list[dict[str, object]]
    image: Pixels
    difference: bytes


def outcome(
    farm: Farm, job_id: str, seconds: float = 200, *, damaged: Set[str] = frozenset()
) -> Outcome:
    """The job's outcome, once it is finished; its invariants are checked."""
    until(lambda: farm.jobs.get(job_id).finished_at is not None, seconds)
    done = farm.client.job(job_id)
    check_job(farm.jobs, farm.store, farm.redis_client, job_id, damaged)
    return Outcome(
        done, farm.curve(done), farm.image(done), farm.client.image(job_id, "difference.png")
    )


def assert_same(one: Outcome, other: Outcome) -> None:
    """Assert that a fault left no trace in what the user has."""
    assert (one.job.state, one.job.spp, one.job.points, one.job.verdict) == (
        other.job.state,
        other.job.spp,
        other.job.points,
        other.job.verdict,
    )
    assert one.curve == other.curve
    assert one.image.tobytes() == other.image.tobytes()
    assert one.difference == other.difference


def check_job(
    jobs: Jobs, store: Blobs, client: redis.Redis, job_id: str, damaged: Set[str] = frozenset()
) -> None:
    """Assert everything that holds of any finished job, whatever happened to it.

    Its sums are kept after its end: where they are among the `damaged` blobs, nothing mends them,
    and where a slice of it is, a monitor that died before it saved them may leave earlier ones.
    """
    job = jobs.get(job_id)
    assert job.finished_at is not None
    _check_ledger(jobs, job_id)
    # The curve has each point once, by rising spp, at whole steps
    spps = [point.spp for point in jobs.curve(job_id)]
    assert len(spps) == job.points
    assert all(a < b for a, b in pairwise(spps))
    plan = jobs.plan(job)
    assert all(plan.is_point(plan.slices_of(spp)) for spp in spps)
    _check_story(jobs, job_id)
    # No blob is orphaned
    expected = {f"{jobs.results(job_id)}/{name}" for name in RESULTS}
    if job.points:
        expected.add(f"{jobs.results(job_id)}/difference.png")
    is_broken = (job.non_finite_pixels or 0) > allowed_non_finite(plan.pixels)
    if job.spp and plan.slices_of(job.spp) > 1 and not is_broken:
        expected.add(f"{jobs.results(job_id)}/noise.png")
        if job.spec.by_quality:
            expected.add(f"{jobs.results(job_id)}/quality.png")
    if job.spec.by_zones:
        expected.add(f"{jobs.results(job_id)}/spp.png")
    if job.spec.keep_slices:
        blobs_kept = {record["blob"] for record in jobs.ledger(job_id).values()}
        expected |= {name for name in blobs_kept if name.startswith(f"jobs/{job_id}/")}
    sums = client.hget(keys.job(job_id), "checkpoint")
    if sums is not None:  # of all that its image shows, unless it keeps the slices themselves
        checkpoint = Checkpoint.model_validate_json(sums)
        assert not job.spec.keep_slices
        lost_slice = any(blob.startswith(blobs.partials(job_id)) for blob in damaged)
        assert lost_slice or plan.spp(checkpoint.slices) == job.spp
        if checkpoint.blob not in damaged:
            assert sha256(store.get(checkpoint.blob)).hexdigest() == checkpoint.sha256
            expected.add(checkpoint.blob)
        elif store.exists(checkpoint.blob):
            expected.add(checkpoint.blob)
    if not job.spp:
        expected = set()
    previews = set(store.names(blobs.previews(job_id)))
    assert len(previews) <= MOST_PREVIEWS
    expected |= previews
    shot = client.hgetall(keys.job(job_id, "shot"))
    if shot and int(shot["looks"]):  # the map of the last look at it
        expected.add(blobs.flicker_map(job_id, int(shot["looks"]) - 1))
    # Of all that is served, Redis knows what its bytes are
    for blob in previews | {f"{jobs.results(job_id)}/{name}" for name in RESULTS if job.spp}:
        assert sha256(store.get(blob)).hexdigest() == jobs.sha256(blob)

    # A worker whose commit came too late takes its partial back a moment later
    def odd() -> set[str]:
        return set(store.names(f"jobs/{job_id}/")) ^ expected

    until(lambda: not odd(), 60, lambda: f"missing, or not expected: {odd()}")
    # And Redis keeps nothing that only a running job needs
    left = set(client.scan_iter(f"{keys.job(job_id)}*", count=1000))
    assert {key.removeprefix(keys.job(job_id)).removeprefix(":") for key in left} <= KEPT
    assert client.zscore(keys.OPEN, job_id) is None
    assert not client.sismember(keys.UNFINISHED, job_id)


def is_of_no_job(key: str) -> bool:
    """Whether Redis may keep the key when there is no job any more."""
    return key in _OF_THE_FARM or key.startswith(_FOR_A_WHILE)


def _check_ledger(jobs: Jobs, job_id: str) -> None:
    """Each slice counts once, and no two have a seed in common."""
    job, ledger = jobs.get(job_id), jobs.ledger(job_id)
    assert job.committed_spp == _spp_of(jobs.plan(job), ledger)
    assert job.spp <= job.committed_spp
    assert set(range(jobs.plan(job).slices_of(job.spp))) <= ledger.keys()
    seeds = sorted((one["first_seed"], one["last_seed"]) for one in ledger.values())
    assert all(first <= last for first, last in seeds)
    assert all(a[1] < b[0] for a, b in pairwise(seeds))
    assert len({one["blob"] for one in ledger.values()}) == len(ledger)


def _spp_of(plan: Plan, slices: Collection[int]) -> int:
    """The samples per pixel of these slices; of a job that failed one in the middle may be lost."""
    if not plan.by_zones or not plan.pixels:
        return plan.spp(len(slices))
    return sum(plan.samples(one + 1) - plan.samples(one) for one in slices) // plan.pixels


def _check_story(jobs: Jobs, job_id: str) -> None:
    """The job moved along the table, from its first state to its end, and finished once."""
    events = jobs.events(job_id)
    moves = [event.data for event in events if event.type == "state"]
    assert moves[0]["to"] == "queued"
    for before, move in pairwise(moves):
        assert move["from"] == before["to"]
        if (move["from"], move["to"]) != ("queued", "queued"):  # what it waits for has changed
            assert JobState(str(move["to"])) in JOB_MOVES[JobState(str(move["from"]))]
        assert move["reason"]
    assert JobState(str(moves[-1]["to"])) is jobs.get(job_id).state
    assert [event.type for event in events].count("finished") == 1
    assert events[-1].type == "finished"
    # Its image was announced once; a first pass may have been shown of one that has none
    images = [event.type for event in events].count("image")
    assert images == 1 if jobs.results(job_id) else images <= 1
    spps = [event.data["spp"] for event in events if event.type == "point"]
    assert spps == [point.spp for point in jobs.curve(job_id)]
