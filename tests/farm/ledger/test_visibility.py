"""Ended jobs are archived, deleted and restored, and lists have what was asked for."""

import itertools
import random

import pytest
import redis

from plateau.farm.ledger.api_keys import ApiKeys, KeyLimits, Role
from plateau.farm.ledger.batches import Batches
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.visibility import Visibilities
from plateau.farm.model.errors import BatchNotFound, JobNotEnded, JobNotFound
from plateau.farm.model.job import Job
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.states import JobState, Visibility
from tests.support.farms.staged_job import StagedJob

LIMITS = KeyLimits(requests_per_minute=60, burst=10, upload_bytes=1, open_jobs=100)
ARCHIVED, DELETED, LISTED = Visibility.ARCHIVED, Visibility.DELETED, Visibility.LISTED


@pytest.fixture
def jobs(client: redis.Redis) -> Jobs:
    return Jobs(client)


@pytest.fixture
def filing(client: redis.Redis) -> Visibilities:
    return Visibilities(client)


def cancelled(jobs: Jobs, *, owner: str = "", name: str = "box", **spec: object) -> str:
    made = jobs.create(JobSpec(**spec), name=name, scene_sha256="00", owner=owner).job
    return jobs.cancel(made.id).id


def visibility(job: Job) -> Visibility:
    assert not (job.archived_at and job.deleted_at)
    return ARCHIVED if job.archived_at else DELETED if job.deleted_at else LISTED


def ids(jobs: Jobs, **wanted: object) -> list[str]:
    return [job.id for job in jobs.search(**wanted)[0]]


@pytest.mark.parametrize(("before", "after"), [*itertools.product(Visibility, repeat=2)])
def test_each_can_follow_each(
    jobs: Jobs, filing: Visibilities, before: Visibility, after: Visibility
) -> None:
    job = cancelled(jobs, batch="b")
    other = cancelled(jobs, batch="b")
    filing.set(job, before)
    filing.set(job, after)
    assert visibility(jobs.get(job)) is after
    lists = {
        LISTED: ids(jobs),
        ARCHIVED: ids(jobs, archived=True),
        DELETED: ids(jobs, deleted=True),
    }
    assert [one for one in Visibility if job in lists[one]] == [after]
    assert ids(jobs, archived=None, deleted=None) == [other, job]
    # A deleted job is in no batch, and comes back to its place in it
    assert ids(jobs, batch="b", archived=None) == ([other] if after is DELETED else [other, job])
    assert ids(jobs, batch="b", archived=None, deleted=None) == [other, job]


def test_only_what_has_ended_can_be_put_away(
    client: redis.Redis, jobs: Jobs, filing: Visibilities
) -> None:
    job = StagedJob(client)
    job.commit()
    for one in Visibility:
        with pytest.raises(JobNotEnded, match="is rendering: it has not ended"):
            filing.set(job.id, one)
        with pytest.raises(JobNotFound):
            filing.set("0" * 12, one)
    # From its end on, even while its images are being written
    job.end()
    filing.set(job.id, DELETED)
    assert visibility(jobs.get(job.id)) is DELETED
    job.finish()
    assert jobs.get(job.id).finished_at is not None


class TestABatch:
    def test_is_put_away_as_one(self, client: redis.Redis, filing: Visibilities) -> None:
        jobs, batches = Jobs(client), Batches(client)
        done = [cancelled(jobs, batch="b") for _ in range(3)]
        filing.set(done[0], ARCHIVED)
        said = filing.set_batch("b", ARCHIVED)
        assert [one.done for one in said] == [True] * 3
        assert [one.before for one in said] == [ARCHIVED, LISTED, LISTED]
        # It is still there, with its jobs, which lists leave out
        assert batches.get("b").job_ids == done
        assert ids(jobs) == ids(jobs, batch="b") == []
        assert [one.job for one in filing.set_batch("b", DELETED)] == done
        for gone in (lambda: batches.get("b"), lambda: filing.set_batch("b", DELETED)):
            with pytest.raises(BatchNotFound):
                gone()
        assert batches.page() == ([], None)
        # And comes back as it was
        assert [one.job for one in filing.set_batch("b", LISTED)] == done
        assert batches.get("b").job_ids == done
        assert [line.name for line in batches.page()[0]] == ["b"]

    def test_keeps_what_renders_and_what_belongs_to_others(
        self, client: redis.Redis, filing: Visibilities
    ) -> None:
        jobs, api_keys = Jobs(client), ApiKeys(client)
        anna, bert = (api_keys.create(name, Role.SUBMITTER, LIMITS)[0].id for name in ("a", "b"))
        mine, theirs = (cancelled(jobs, batch="b", owner=owner) for owner in (anna, bert))
        renders = jobs.create(JobSpec(batch="b"), name="box", scene_sha256="00", owner=anna).job
        said = filing.set_batch("b", DELETED, may_touch=lambda owner: owner == anna)
        assert [(one.job, one.done, one.why_not) for one in said] == [
            (mine, True, None),
            (theirs, False, "it belongs to another API key"),
            (renders.id, False, "it has not ended"),
        ]
        assert Batches(client).get("b").job_ids == [theirs, renders.id]


def test_the_lists_are_those_of_a_plain_filter(client: redis.Redis, filing: Visibilities) -> None:
    """Against a model that looks at each job; the seed is fixed."""
    jobs, api_keys = Jobs(client), ApiKeys(client)
    chance = random.Random(7)
    owners = {"": None}
    for name in ("Anna", "Bert"):
        key, _ = api_keys.create(name, Role.SUBMITTER, LIMITS)
        owners[key.id] = name
    for number in range(60):
        owner = chance.choice(list(owners))
        batch = chance.choice([None, "dusk", "dawn"])
        spec = JobSpec(
            batch=batch,
            name=chance.choice([None, f"Frame {number}"]),
            requires=chance.choice([(), ("big-memory",)]),
        )
        scene = chance.choice(["kitchen", "lamp"])
        job = jobs.create(spec, name=scene, scene_sha256="00", owner=owner).job
        if chance.random() < 0.8:
            jobs.cancel(job.id)
            for one in chance.choices(list(Visibility), k=chance.randrange(3)):
                filing.set(job.id, one)
    every = jobs.search(archived=None, deleted=None, limit=100)[0]
    assert len(every) == 60

    def has(job: Job, search: str) -> bool:
        spec = job.spec
        texts = (job.id, job.name, spec.name, spec.batch, job.owner_name, *spec.requires)
        return all(word in " ".join(filter(None, texts)).lower() for word in search.split())

    flags = (False, True, None)
    for state, batch, owner, archived, deleted, search in itertools.product(
        (None, JobState.QUEUED, JobState.CANCELLED),
        (None, "dusk"),
        (None, next(owner for owner in owners if owner)),
        flags,
        flags,
        ("", "kitchen", "frame 1", "anna dusk", "big-mem", every[7].id[:9], "nothing"),
    ):
        wanted = [
            job.id
            for job in every
            if state in {None, job.state}
            and batch in {None, job.spec.batch}
            and owner in {None, job.owner}
            and archived in {None, job.archived_at is not None}
            and deleted in {None, job.deleted_at is not None}
            and has(job, search)
        ]
        asked = {"state": state, "batch": batch, "owner": owner, "search": search.upper()}
        found, before = [], None
        while True:
            page, before = jobs.search(
                **asked, archived=archived, deleted=deleted, before=before, limit=7
            )
            assert len(page) <= 7
            found += [job.id for job in page]
            if before is None:
                break
        assert found == wanted, (asked, archived, deleted)
