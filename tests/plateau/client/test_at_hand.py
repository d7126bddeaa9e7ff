"""The client takes what people have at hand, and what it returns can be passed on."""

import inspect
import pickle
from collections.abc import Callable

import numpy as np
import pytest
import redis

import plateau as package
import plateau.client.errors
import plateau.errors
from plateau import ApiError, BadId, Client, ClientError, FixedSpec, TimedOut, Unreachable
from plateau.client import BadUrl, InvalidSpec, NoImageYet, UnknownJob, UnknownScene
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.spec.notice import NoticeSpec
from tests.support.farms.staged_job import StagedJob


class TestScenes:
    def test_by_the_name_of_an_example_or_a_path_as_text(self, plateau: Client) -> None:
        job = plateau.submit("scenes:box", max_spp=200)
        assert (job.name, job.spec.max_spp) == ("box", 200)
        from plateau import scenes

        assert plateau.submit(str(scenes.FOLDER / "box")).scene_sha256 == job.scene_sha256
        assert plateau.submit(job.scene_sha256).scene_sha256 == job.scene_sha256
        # With a key of its own, a request makes one job
        once = [plateau.submit("scenes:box", idempotency_key="once").id for _ in range(2)]
        assert once[0] == once[1] != job.id

    def test_fields_replace_those_of_a_spec(self, plateau: Client) -> None:
        spec = JobSpec(max_spp=200, seed=1)
        job = plateau.submit("scenes:box", spec, seed=2, view={"exposure_ev": 1})
        assert (job.spec.max_spp, job.spec.seed, job.spec.view.exposure_ev) == (200, 2, 1.0)
        with pytest.raises(InvalidSpec, match="max_sp"):
            plateau.submit("scenes:box", max_sp=200)

    def test_numbers_of_numpy(self, plateau: Client) -> None:
        spec = JobSpec(
            max_spp=np.int64(200),
            view={"background": np.array([0, 0.5, 1])},
            parameters={"width": np.int32(64), "height": np.uint8(32), "intensity": np.float64(2)},
        )
        job = plateau.submit("scenes:box", spec)
        assert (job.spec.view.background, job.spec.max_spp) == ((0, 0.5, 1), 200)
        assert job.spec.parameter_strings() == {"width": "64", "height": "32", "intensity": "2.0"}
        assert plateau.set_priority(job.id, np.int64(7)).spec.priority == 7


def test_any_cap_will_do_and_a_note_says_what_it_takes(
    plateau: Client, client: redis.Redis
) -> None:
    job = plateau.submit("scenes:box", max_spp=10, slice_spp=20)
    assert (job.spec.max_spp, job.spec.slice_spp) == (10, 5)
    note = "slice_spp is 5 in place of 20: steps and the cap are whole numbers of slices"
    assert job.notes == (note,)
    # It stays with those of the worker
    staged = StagedJob(client, job.id)
    staged.commit()
    assert plateau.job(job.id).notes == (note,)
    staged.end()
    staged.finish()
    assert plateau.job(job.id).notes == (note,)


def test_ids_may_be_shortened(plateau: Client, client: redis.Redis) -> None:
    job = StagedJob(client).id
    assert plateau.job(job[:6]).id == plateau.whole_id(job[:4]) == job
    assert plateau.curve(job[:5]) == []
    assert plateau.cancel(job[:4]).id == job
    assert [one.id for one in plateau.all_jobs()] == [job]
    unknown = next(text for text in ("0000", "ffff") if not job.startswith(text))
    with pytest.raises(BadId, match=f"no job has an id that begins with {unknown}"):
        next(plateau.events(unknown))


def test_a_job_is_rendered_again_by_part_of_its_id(plateau: Client, client: redis.Redis) -> None:
    job = plateau.submit("scenes:box").id
    with pytest.raises(ApiError, match="rendered again"):
        plateau.again(job)
    plateau.cancel(job)
    other = StagedJob(client).id
    again = plateau.again(
        job, idempotency_key="k", after=[other[:5]], rule=FixedSpec(spp=np.int8(9))
    )
    assert (again.spec.after, again.spec.rule) == ((other,), FixedSpec(spp=9))
    assert again.again.of == job
    same = plateau.again(job, idempotency_key="k", after=[other], rule=FixedSpec(spp=9))
    assert same.id == again.id
    # A notice has its secret, though no answer shows it
    notice = NoticeSpec(url="https://studio.example/x", secret="whsec_" + 32 * "A")
    assert plateau.again(job, notice=notice).spec.notice.receivers == (
        "https://studio.example:443",
    )


def test_a_job_comes_after_others_by_their_first_letters(
    plateau: Client, client: redis.Redis
) -> None:
    # A batch whose name may begin an id, and a job whose id does not begin so
    while (job := StagedJob(client, batch="cafe").id).startswith("cafe"):
        client.flushall()
    after = plateau.submit("scenes:box", after=(job[:5], "cafe")).spec.after
    assert after == (job, "cafe")
    batch = plateau.submit_batch("scenes:box", [{"width": 9}], JobSpec(after=(job[:5],)))
    assert plateau.job(batch.job_ids[0]).spec.after == (job,)


def test_problems_have_types(plateau: Client, client: redis.Redis) -> None:
    with pytest.raises(UnknownJob) as caught:
        plateau.job("0123456789ab")
    assert (caught.value.status, caught.value.slug) == (404, "unknown-job")
    with pytest.raises(NoImageYet):
        plateau.array(StagedJob(client).id)
    with pytest.raises(UnknownScene):
        plateau.submit(64 * "0")


@pytest.mark.parametrize(
    "made",
    [
        lambda: ApiError(409, {"type": "/problems/job-ended", "detail": "it has"}, retry_after_s=2),
        lambda: UnknownJob(404, {"detail": "none"}),
        lambda: BadUrl("nowhere"),
        lambda: Unreachable("http://a", "silence"),
        lambda: TimedOut("job a", 3),
        lambda: package.errors.ExtraMissing("numba", "monitor"),
    ],
)
def test_errors_can_be_pickled(made: Callable[[], Exception]) -> None:
    error = made()
    again = pickle.loads(pickle.dumps(error))
    assert (type(again), str(again), vars(again)) == (type(error), str(error), vars(error))
    assert isinstance(again, package.errors.PlateauError)


def test_clients_and_jobs_can_be_pickled(plateau: Client, client: redis.Redis) -> None:
    job = plateau.job(StagedJob(client).id)
    assert pickle.loads(pickle.dumps(job)) == job
    with pickle.loads(pickle.dumps(Client(plateau.url, patience_s=1.0))) as again:
        assert again.job(job.id) == job


def test_all_of_its_own_errors_have_one_base() -> None:
    errors = [value for value in vars(package.client.errors).values() if inspect.isclass(value)]
    own = [one for one in errors if one.__module__ == "plateau.client.errors"]
    assert all(issubclass(one, ClientError) for one in own)
