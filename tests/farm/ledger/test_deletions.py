"""Ended jobs are deleted and restored, and lists have what was asked for."""

import itertools
import random

import pytest
import redis

from plateau.farm.ledger.api_keys import ApiKeys, KeyLimits, Role
from plateau.farm.ledger.batches import Batches
from plateau.farm.ledger.deletions import Deletions
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.model.errors import BatchNotFound
from plateau.farm.model.job import Job
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.states import JobState

LIMITS = KeyLimits(upload_bytes=1, open_jobs=100)


@pytest.fixture
def deletions(client: redis.Redis) -> Deletions:
    return Deletions(client)


def cancelled(jobs: Jobs, *, owner: str = "", name: str = "box", **spec: object) -> str:
    made = jobs.create(JobSpec(**spec), name=name, scene_sha256="00", owner=owner).job
    return jobs.cancel(made.id).id


def ids(jobs: Jobs, **wanted: object) -> list[str]:
    return [job.id for job in jobs.search(**wanted)[0]]


class TestABatch:
    def test_goes_as_one(self, client: redis.Redis, deletions: Deletions) -> None:
        jobs, batches = Jobs(client), Batches(client)
        done = [cancelled(jobs, batch="b") for _ in range(3)]
        said = deletions.set_batch("b", deleted=True)
        assert [(one.job, one.done) for one in said] == [(job, True) for job in done]
        for gone in (lambda: batches.get("b"), lambda: deletions.set_batch("b", deleted=True)):
            with pytest.raises(BatchNotFound):
                gone()
        assert batches.page() == ([], None)
        # And comes back as it was
        assert [one.job for one in deletions.set_batch("b", deleted=False)] == done
        assert batches.get("b").job_ids == done
        assert [line.name for line in batches.page()[0]] == ["b"]

    def test_keeps_what_renders_and_what_belongs_to_others(
        self, client: redis.Redis, deletions: Deletions
    ) -> None:
        jobs, api_keys = Jobs(client), ApiKeys(client)
        anna, bert = (api_keys.create(name, Role.SUBMITTER, LIMITS)[0].id for name in ("a", "b"))
        mine, theirs = (cancelled(jobs, batch="b", owner=owner) for owner in (anna, bert))
        renders = jobs.create(JobSpec(batch="b"), name="box", scene_sha256="00", owner=anna).job
        said = deletions.set_batch("b", deleted=True, may_touch=lambda owner: owner == anna)
        assert [(one.job, one.done, one.why_not) for one in said] == [
            (mine, True, None),
            (theirs, False, "it belongs to another API key"),
            (renders.id, False, "it has not ended"),
        ]
        assert Batches(client).get("b").job_ids == [theirs, renders.id]


def test_the_lists_are_those_of_a_plain_filter(client: redis.Redis, deletions: Deletions) -> None:
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
            for one in chance.choices((False, True), k=chance.randrange(3)):
                deletions.set(job.id, deleted=one)
    every = jobs.search(deleted=None, limit=100)[0]
    assert len(every) == 60

    def has(job: Job, search: str) -> bool:
        spec = job.spec
        texts = (job.id, job.name, spec.name, spec.batch, job.owner_name, *spec.requires)
        return all(word in " ".join(filter(None, texts)).lower() for word in search.split())

    for state, batch, owner, deleted, search in itertools.product(
        (None, JobState.QUEUED, JobState.CANCELLED),
        (None, "dusk"),
        (None, next(owner for owner in owners if owner)),
        (False, True, None),
        ("", "kitchen", "frame 1", "anna dusk", "big-mem", every[7].id[:9], "nothing"),
    ):
        wanted = [
            job.id
            for job in every
            if state in {None, job.state}
            and batch in {None, job.spec.batch}
            and owner in {None, job.owner}
            and deleted in {None, job.deleted_at is not None}
            and has(job, search)
        ]
        asked = {"state": state, "batch": batch, "owner": owner, "search": search.upper()}
        found, before = [], None
        while True:
            page, before = jobs.search(**asked, deleted=deleted, before=before, limit=7)
            assert len(page) <= 7
            found += [job.id for job in page]
            if before is None:
                break
        assert found == wanted, (asked, deleted)
