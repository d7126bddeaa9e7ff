"""Ended jobs are rendered again: where samples are kept, as if the job had never been stopped."""

from collections.abc import Callable, Iterator
from typing import Any

import httpx
import pytest
import redis
from pydantic import ValidationError

from plateau.farm.blobs import names as blobs
from plateau.farm.images.exr import decode_image
from plateau.farm.ledger.batches import Batches
from plateau.farm.ledger.continuation import Continuations, Remains, changed_spec, lost_by
from plateau.farm.ledger.totals import take_census
from plateau.farm.model.errors import JobNotEnded
from plateau.farm.model.job import Job
from plateau.farm.model.seeds import SeedSchedule
from plateau.farm.model.slices.plan import Plan
from plateau.farm.model.spec import PLACES, JobSpec
from plateau.farm.model.states import JobState
from plateau.farm.redis import keys
from plateau.farm.sweep import sweep
from plateau.farm.wire.examples import SCENE_XML
from tests.support import FRAMES
from tests.support.api_calls import submit
from tests.support.farms.finished_jobs import go_on, loses
from tests.support.farms.live_api import live_http
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.faults.invariants import check_job
from tests.support.until import until

SLICE, STEP = 10, 20
DAY_S = 86_400
QUICK = {"step": STEP, "slice_spp": SLICE, "max_spp": 400, "rule": {"name": "fixed", "spp": 80}}


def work(farm: NoiseFarm, job: Job) -> Job:
    """Render slices as they are planned, until the job is finished; its invariants are checked."""
    done = farm.finish(job)
    check_job(farm.jobs, farm.store, farm.jobs._redis, job.id)
    return done


def pixels(farm: NoiseFarm, job: Job) -> bytes:
    return decode_image(farm.picture(job, "image.exr")).tobytes()


#: A point that was taken over has its time, and speaks of the rules of its own job.
OF_ITS_JOB = {*("at", "rules", "expected_spp")}


def curve(farm: NoiseFarm, job: Job) -> list[dict[str, Any]]:
    return [point.model_dump(exclude=OF_ITS_JOB) for point in farm.jobs.curve(job.id)]


def rendered(farm: NoiseFarm, job: Job) -> list[int]:
    """The slices that were rendered for this job itself."""
    events = farm.jobs.events(job.id)
    return [int(str(event.data["index"])) for event in events if event.type == "slice"]


@pytest.mark.parametrize(
    ("keep_slices", "rule"),
    [
        (False, {"name": "visible", "target": 0.95, "min_spp": 160}),
        (True, {"name": "fixed", "spp": 200}),
    ],
    ids=["from its sums", "from its slices"],
)
def test_a_stricter_rule_goes_on_as_if_it_had_ruled_from_the_start(
    farm: NoiseFarm, rule: dict[str, Any], keep_slices: bool
) -> None:
    with farm.monitor():
        # Given a job that stopped, and one that has the stricter rule from the start
        stopped = work(farm, farm.submit(**QUICK, keep_slices=keep_slices))
        before = pixels(farm, stopped), curve(farm, stopped), farm.jobs.get(stopped.id)
        never_stopped = work(farm, farm.submit(**{**QUICK, "rule": rule}))
        # When the first is gone on with
        done = work(farm, go_on(farm, stopped, rule=rule))
    # Then all is as if it had never been stopped
    assert (done.state, done.spp) == (JobState.CONVERGED, never_stopped.spp)
    assert done.spp > stopped.spp == 80
    assert pixels(farm, done) == pixels(farm, never_stopped)
    assert curve(farm, done) == curve(farm, never_stopped)
    assert done.verdict == never_stopped.verdict
    # No slice was rendered twice
    assert set(rendered(farm, done)).isdisjoint(range(8))
    assert farm.jobs.ledger(done.id).keys() >= set(range(done.spp // SLICE))
    # And the old job is as it was
    after = pixels(farm, stopped), curve(farm, stopped), farm.jobs.get(stopped.id)
    assert after == before
    assert done.again.of == stopped.id
    kept = len(farm.jobs.ledger(stopped.id)) if keep_slices else 8
    assert done.again.kept_spp == kept * SLICE
    assert done.continued_spp == (0 if keep_slices else 80)


def is_due(farm: NoiseFarm) -> Job:
    """A job that is cancelled after four slices are judged, when three more have come at once."""
    job = farm.submit(**QUICK)
    with farm.monitor():
        farm.render(4)
        until(lambda: farm.jobs.get(job.id).spp == 40)
        held = [farm.next_lease() for _ in range(3)]
    for lease in held:
        farm.commit(lease)
    farm.jobs.cancel(job.id)
    return job


def has_failed(farm: NoiseFarm) -> Job:
    job = farm.submit(**QUICK)
    with farm.monitor():
        farm.render(4)
        until(lambda: farm.jobs.get(job.id).spp == 40)
        farm.queue.fail(farm.next_lease(), "no such driver")
    return job


@pytest.mark.parametrize(("end", "slices"), [(is_due, 7), (has_failed, 4)])
def test_one_that_ended_too_soon_can_be_taken_up_again(
    farm: NoiseFarm, end: Callable[[NoiseFarm], Job], slices: int
) -> None:
    job = end(farm)
    with farm.monitor():
        until(lambda: farm.jobs.get(job.id).finished_at is not None)
        ended = farm.jobs.get(job.id)
        assert ended.again is None
        done = work(farm, go_on(farm, ended))
        undisturbed = work(farm, farm.submit(**QUICK))
    assert done.again.kept_spp == slices * SLICE
    assert (done.state, done.spp) == (JobState.CONVERGED, 80)
    assert pixels(farm, done) == pixels(farm, undisturbed)
    assert curve(farm, done) == curve(farm, undisturbed)
    assert min(rendered(farm, done)) == slices


def test_under_another_view_kept_slices_are_judged_again_and_nothing_is_rendered(
    farm: NoiseFarm,
) -> None:
    other = {"field_of_view_deg": 5.0, "exposure_ev": 2.0}
    seen = {**PLACES["paper"], **other}
    with farm.monitor():
        job = work(farm, farm.submit(**QUICK, keep_slices=True))
        ledger = farm.jobs.ledger(job.id)
        cap = len(ledger) * SLICE
        judged = work(farm, go_on(farm, job, view=other, step=10, max_spp=cap))
        from_the_start = work(farm, farm.submit(**{**QUICK, "view": seen, "step": 10}))
    assert rendered(farm, judged) == []
    assert judged.machine_s == 0
    assert judged.spec.view.field_of_view_deg == 5
    assert curve(farm, judged) == curve(farm, from_the_start) != curve(farm, job)
    # The slices are still there, and still the old job's
    assert farm.jobs.ledger(job.id) == ledger
    assert all(farm.store.exists(record["blob"]) for record in ledger.values())


@pytest.mark.parametrize("harm", ["lost", "spoiled"])
def test_sums_that_are_lost_meanwhile_cost_time_only(farm: NoiseFarm, harm: str) -> None:
    with farm.monitor():
        stopped = work(farm, farm.submit(**QUICK))
        undisturbed = work(farm, farm.submit(**{**QUICK, "rule": {"name": "fixed", "spp": 120}}))
    # Given a job that goes on, of which the sums are lost before a monitor comes to it; by its new
    # rule it would have stopped earlier than it did
    job = go_on(farm, stopped, rule={"name": "visible", "target": 0.99, "min_spp": 20})
    (sums,) = farm.store.names(blobs.checkpoints(stopped.id))
    farm.store.delete(sums) if harm == "lost" else farm.store.put(sums, b"spoiled")
    with farm.monitor():
        done = work(farm, job)
    # Then its slices are rendered again, and it stops where it would have
    assert sorted(rendered(farm, done))[:8] == list(range(8))
    assert (done.state, done.spp) == (JobState.CONVERGED, 100)
    assert curve(farm, done) == curve(farm, undisturbed)[:5]


def test_sums_stay_for_a_job_that_still_stands_on_them(
    farm: NoiseFarm, client: redis.Redis
) -> None:
    # Given a job that ended long ago, and one that has just gone on with its sums
    with farm.monitor():
        old = work(farm, farm.submit(**QUICK))
    new = go_on(farm, old, rule={"name": "fixed", "spp": 120})
    client.hset(keys.job(old.id), "finished_at", farm.jobs.now_ms() - 4 * DAY_S * 1000)
    # When the farm is swept, then the sums stay
    for dry_run in (True, False):
        assert sweep(client, farm.store, sums_older_than_s=3 * DAY_S, dry_run=dry_run).sums == 0
    with farm.monitor():
        done = work(farm, new)
    # And no slice is rendered twice
    assert set(rendered(farm, done)).isdisjoint(range(8))
    # When the new one has sums of its own, those of the old one go, and its own stay
    for dry_run in (True, False):
        assert sweep(client, farm.store, sums_older_than_s=3 * DAY_S, dry_run=dry_run).sums == 1
    assert farm.store.names(blobs.checkpoints(old.id)) == []
    assert Continuations(client).remains(done).slices == 12


@pytest.mark.parametrize(
    ("spp", "cap", "to", "seed", "why"),
    [
        # Larger passes, and smaller ones
        (10_000, 10_000, 20_000, 0, "max_spp"),
        (10_000, 10_000, 14_625, 0, None),
        (10_000, 10_000, 14_650, 0, "max_spp"),
        (2500, 20_000, 10_000, 0, "max_spp"),
        (2500, 20_000, 14_650, 0, None),
        (2500, 20_000, 25_600, 0, None),
        # Beyond all seeds, though LLVM would have enough
        (10_000, 10_000, 1_000_000, 0, "max_spp"),
        # With a seed of its own only the same cap keeps them
        (500, 2000, 2000, 1, None),
        (500, 2000, 1975, 1, "max_spp"),
        (500, 2000, 2025, 1, "max_spp"),
    ],
)
def test_on_scalar_variants_the_cap_decides_which_passes_and_seeds_the_samples_have(
    farm: NoiseFarm, spp: int, cap: int, to: int, seed: int, why: str | None
) -> None:
    made = farm.submit(max_spp=cap, seed=seed)
    film = {"variant": "scalar_rgb", "width": 1024, "height": 1024}
    job = made.model_copy(update={**film, "state": JobState.EXHAUSTED})
    drawn = SeedSchedule("scalar_rgb", 1024, 1024, 25, cap, seed)
    seeds = tuple(drawn.seed_range(index) for index in range(spp // 25))
    remains = Remains(spp // 25, "sums", seeds, Plan.of(job.spec))
    assert lost_by(job, remains, JobSpec(**FRAMES, max_spp=to, seed=seed)) == why


def test_sums_are_lost_to_changes_that_they_do_not_bear(
    farm: NoiseFarm, client: redis.Redis
) -> None:
    with farm.monitor():
        ended = work(farm, farm.submit(**QUICK, parameters={"width": 32}))
    for why, changed in (
        ("seed", 1),
        ("parameters", {"width": "33"}),
        ("variant", "scalar_rgb"),
        ("after", ["walk"]),
        ("view", {"exposure_ev": 1}),
        ("step", 40),
        ("keep_slices", True),
        ("rule", {"name": "multiple"}),
        ("watch", [{"name": "multiple"}]),
        ("max_spp", 80),
    ):
        assert loses(farm, ended, **{why: changed}) == why
    # A parameter may be written otherwise
    same = {"priority": 5, "name": "other", "parameters": {"width": "32"}}
    assert loses(farm, ended, **same) is None
    # Sums that went between the look and the start start nothing
    continuations = Continuations(client)
    remains = continuations.remains(ended)
    assert remains is not None
    client.hdel(keys.job(ended.id), "checkpoint")
    assert continuations.start(ended, remains, ended.spec) is None
    assert continuations.remains(ended) is None
    # And it has to have ended, and to have written its results
    client.hdel(keys.job(ended.id), "finished_at")
    with pytest.raises(JobNotEnded, match="its results are being written"):
        go_on(farm, farm.jobs.get(ended.id))
    with pytest.raises(JobNotEnded, match="is queued: it has not ended"):
        go_on(farm, farm.submit(**QUICK))


def test_changes_are_a_merge_patch_and_a_named_rule_is_another() -> None:
    spec = JobSpec.model_validate({"rule": {"name": "visible", "target": 0.5}, "max_spp": 500})

    def changed(**changes: Any) -> JobSpec:
        return JobSpec.model_validate(changed_spec(spec, changes))

    assert changed() == spec
    assert changed(rule={"min_spp": 7}).rule.model_dump() == {
        "name": "visible",
        "target": 0.5,
        "min_spp": 7,
    }
    assert changed(rule={"name": "reverse"}).rule.model_dump()["window"] == 5
    assert changed(view={"exposure_ev": 2}).view.exposure_ev == 2
    assert changed(max_spp=None).max_spp == 10_000
    # A null takes away what is there, or may be, and no field has a name that nobody knows
    assert changed(batch=None, notice=None, parameters={"w": None}) == spec
    for unknown in ({"typo": None}, {"view": {"typo": None}}, {"rule": {"typo": None}}):
        with pytest.raises(ValidationError, match="typo"):
            changed(**unknown)


class TestOverHttp:
    @pytest.fixture
    def http(self, farm: NoiseFarm, redis_url: str) -> Iterator[httpx.Client]:
        with live_http(redis_url, farm.store) as http:
            yield http

    def test_a_job_goes_on_once_however_often_it_is_asked(
        self, farm: NoiseFarm, http: httpx.Client
    ) -> None:
        with farm.monitor():
            ended = work(farm, farm.submit(**QUICK, batch="tuesday"))
        # What cannot be is said, and makes no job
        for refused, slug in (
            ({"nonsense": 3}, "invalid-spec"),
            ({"rule": {"spp": "many"}}, "invalid-spec"),
            ({"max_spp": 10**9}, "invalid-spec"),
            ({"shot": {"fps": 24}}, "invalid-spec"),
            ({"parameters": ["width=32", "=3"]}, "invalid-spec"),
            ([1], "invalid-request"),
        ):
            answer = http.post(f"/v1/jobs/{ended.id}/again", json=refused)
            assert answer.json()["type"] == f"/problems/{slug}", answer.text
        assert [job["id"] for job in http.get("/v1/jobs").json()["jobs"]] == [ended.id]
        path, body = f"/v1/jobs/{ended.id}/again", {"rule": {"spp": 120}}
        first, second = (
            http.post(path, json=body, headers={"Idempotency-Key": "once"}) for _ in range(2)
        )
        assert (first.status_code, second.status_code) == (201, 201)
        job = first.json()
        assert first.headers["location"] == job["links"]["self"]
        assert second.json()["id"] == job["id"]
        assert second.headers["idempotency-replayed"] == "true"
        # It has the samples, the curve and the image of the old one, and renders
        assert job["state"] == "rendering"
        assert job["again"] == {"of": ended.id, "kept_spp": 80, "why": None}
        assert (job["spp"], job["continued_spp"], job["points"]) == (80, 80, 4)
        assert job["spec"]["rule"] == {"name": "fixed", "spp": 120}
        assert job["spec"]["batch"] == "tuesday"
        assert http.get(job["links"]["image_png"]).status_code == 200
        points = http.get(job["links"]["curve"]).json()["points"]
        assert [point["spp"] for point in points] == [20, 40, 60, 80]
        with farm.monitor():
            assert work(farm, farm.jobs.get(job["id"])).spp == 120
        # The same key for something else is refused
        other = http.post(path, json={}, headers={"Idempotency-Key": "once"})
        assert other.json()["type"] == "/problems/idempotency-key-reused"
        # Where its scene lies in a root, other tags do not send it to workers without that
        spec = ended.spec.model_copy(update={"requires": ("root.a",)})
        farm.jobs._redis.hset(keys.job(ended.id), "spec", spec.model_dump_json())
        elsewhere = http.post(path, json={"rule": {"spp": 120}, "requires": ["gpu"]}).json()
        assert elsewhere["again"]["kept_spp"] == 80
        assert elsewhere["spec"]["requires"] == ["gpu", "root.a"]

    def test_where_samples_cannot_be_kept_all_is_rendered_anew(
        self, farm: NoiseFarm, http: httpx.Client
    ) -> None:
        # Given an exhausted job on a scalar variant, with a seed of its own
        made = submit(http, SCENE_XML, {**QUICK, "max_spp": 60, "seed": 1}).json()
        with farm.monitor():
            old = work(farm, farm.jobs.get(made["id"]))
        assert old.state is JobState.EXHAUSTED
        # When it is rendered again with what draws other samples
        for changes, why in (({"max_spp": 100}, "max_spp"), ({"seed": 2}, "seed")):
            body = {**changes, "name": "other"}
            headers = {"Idempotency-Key": why}
            path = f"/v1/jobs/{old.id}/again"
            first, second = (http.post(path, json=body, headers=headers) for _ in range(2))
            # Then that is a job of its own, which begins with none
            new = first.json()
            assert new["again"] == {"of": old.id, "kept_spp": 0, "why": why}, first.text
            assert (new["state"], new["spp"]) == ("queued", 0)
            assert new["scene_sha256"] == old.scene_sha256
            assert second.json()["id"] == new["id"]
            assert second.headers["idempotency-replayed"] == "true"

    def test_the_scene_is_checked_with_what_changes(
        self, http: httpx.Client, farm: NoiseFarm
    ) -> None:
        scene = SCENE_XML.replace('<default name="width" value="256"/>', "")
        old = submit(http, scene, {"parameters": {"width": 64}}).json()
        farm.jobs.cancel(old["id"])
        answer = http.post(old["links"]["again"], json={"parameters": {"width": None}})
        assert answer.json()["type"] == "/problems/broken-scene", answer.text
        assert answer.json()["code"] == "undefined-parameter"


class TestSamplesSaved:
    """What jobs would have cost otherwise: a job, its batch and the farm say the same."""

    PIXELS = 32 * 24

    def saved(self, farm: NoiseFarm, *done: Job) -> list[int]:
        """Samples that each of these jobs saved, which are all of its batch and of the farm."""
        each = [job.samples_saved for job in done]
        batch = Batches(farm.jobs._redis).get("b")
        assert batch.samples_saved == take_census(farm.client).samples_saved == sum(each)
        return [samples // self.PIXELS for samples in each]

    def test_are_those_that_the_cap_allowed_beyond_what_a_job_took_over(
        self, farm: NoiseFarm
    ) -> None:
        loose, strict = (
            {"name": "visible", "target": target, "min_spp": 40} for target in (0.99, 0.95)
        )
        asked = {**QUICK, "rule": loose, "batch": "b"}
        with farm.monitor():
            # Given a job that converged, one that went on from its sums, and one from its slices
            first = work(farm, farm.submit(**asked))
            second = work(farm, go_on(farm, first, rule={**strict, "min_spp": 100}, batch="b"))
            kept = work(farm, farm.submit(**{**asked, "keep_slices": True}))
            # And one that judged again what was kept, up to there: nothing was to be rendered
            slices = len(farm.jobs.ledger(kept.id))
            judged = work(farm, go_on(farm, kept, max_spp=slices * SLICE, batch="b"))
        done = first, second, kept, judged
        assert {job.state for job in done} == {JobState.CONVERGED}
        assert second.spp > first.spp
        # Then each saved what its cap allowed it to render and it did not
        assert self.saved(farm, *done) == [400 - first.spp, 400 - second.spp, 400 - kept.spp, 0]
