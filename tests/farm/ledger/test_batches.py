"""Batches: made at once, summed up, steered, and forgotten."""

from datetime import datetime, timedelta, timezone
from typing import Any

import pytest
import redis

from plateau.farm.ledger.batches import Batches, Steer
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.queue import SliceQueue
from plateau.farm.ledger.totals import take_census
from plateau.farm.model.batch import Member, summarise
from plateau.farm.model.errors import BatchNotFound
from plateau.farm.model.spec import BatchSpec, JobSpec
from plateau.farm.model.states import JobState
from plateau.farm.redis import keys
from plateau.farm.redis.commands.sweeps import Forget
from plateau.farm.redis.scripts import Scripts
from tests.support.farms.staged_job import StagedJob


@pytest.fixture
def batches(client: redis.Redis) -> Batches:
    return Batches(client)


def create(jobs: Jobs, count: int = 3, batch: str = "b", **spec: Any) -> list[str]:
    """The ids of the jobs of a list, in its order."""
    asked = BatchSpec(parameters=[{"frame": frame} for frame in range(count)], **spec)
    made = jobs.create(*asked.job_specs(batch), name="box", scene_sha256="00")
    assert not made.repeated
    found, _ = jobs.search(batch=batch, limit=1000)
    ids = [job.id for job in found][::-1]
    assert made.job.id in ids
    return ids


def finish(client: redis.Redis, job_id: str, state: JobState, *, spp: int = 100) -> StagedJob:
    staged = StagedJob(client, job_id)
    staged.commit(spp // staged.spec.slice_spp)
    staged.point(spp, 5)
    staged.end(state)
    staged.finish(spp)
    return staged


def test_a_list_of_a_thousand_is_made_at_once(jobs: Jobs, batches: Batches) -> None:
    assert len(create(jobs, 1000)) == 1000
    assert batches.get("b").states == {JobState.QUEUED: 1000}


class TestTheIndex:
    def test_of_a_state_follows_every_move(self, client: redis.Redis, jobs: Jobs) -> None:
        def listed() -> dict[str, list[str]]:
            found = {state: jobs.search(state=state)[0] for state in JobState}
            return {state.value: [job.id for job in of] for state, of in found.items() if of}

        staged = StagedJob(client)
        assert listed() == {"queued": [staged.id]}
        staged.commit()
        assert listed() == {"rendering": [staged.id]}
        jobs.pause(staged.id)
        assert listed() == {"paused": [staged.id]}
        jobs.resume(staged.id)
        staged.end(JobState.EXHAUSTED)
        assert listed() == {"exhausted": [staged.id]}

    def test_goes_with_the_last_job(
        self, client: redis.Redis, jobs: Jobs, batches: Batches
    ) -> None:
        before = set(client.keys("*"))
        ids = create(jobs, 3)
        create(jobs, 1, "newer")
        for job_id in ids:
            finish(client, job_id, JobState.CONVERGED)
        # When its newest job is forgotten, it is as new as the one before
        scripts = Scripts(client)
        assert scripts.run(Forget(job=ids[2], finished_for_ms=0)) == "forgotten"
        assert client.zscore(keys.BATCHES, "b") == client.zscore(keys.JOBS, ids[1])
        assert batches.get("b").job_ids == ids[:2]
        for job_id in ids[:2]:
            assert scripts.run(Forget(job=job_id, finished_for_ms=0)) == "forgotten"
        with pytest.raises(BatchNotFound, match="'b'"):
            batches.get("b")
        assert [line.name for line in batches.page()[0]] == ["newer"]
        [other] = jobs.search()[0]
        finish(client, other.id, JobState.FAILED)
        scripts.run(Forget(job=other.id, finished_for_ms=0))
        left = set(client.keys("*")) - before
        assert left <= {"plateau:store", "plateau:totals", "plateau:heard"}


NOW = datetime(2026, 11, 21, 12, tzinfo=timezone.utc)


def member(number: int, state: JobState, **other: Any) -> Member:
    """A job that was begun a minute ago, if it was, and rendered 10 spp a second."""
    spp = other.get("spp", 0)
    began = NOW - timedelta(seconds=60) if spp else None
    values: dict[str, Any] = {
        "id": f"job-{number}",
        "spec": JobSpec(),
        "state": state,
        "held": False,
        "spp": spp,
        "committed_spp": spp,
        "estimate_fraction": None,
        "expected_spp": None,
        "machine_s": spp / 10,
        "samples_saved": 0,
        "created_at": NOW - timedelta(seconds=90),
        "started_at": began,
        "ended_at": NOW if state.ended else None,
        "finished": state.ended,
    }
    return Member(**{**values, **other})


class TestAForecast:
    """Two jobs rendered 600 spp in a minute: 60 s of machines, so one worker's worth."""

    DONE = member(0, JobState.CONVERGED, spp=400)

    def test_adds_what_each_job_still_needs_at_the_rate_so_far(self) -> None:
        members = [
            self.DONE,
            member(1, JobState.RENDERING, spp=200, expected_spp=500),
            member(2, JobState.QUEUED),  # as the one that converged
        ]
        found = summarise("b", members, now=NOW).forecast_end_at
        assert found == NOW + timedelta(seconds=(300 + 400) / 10)

    def test_ends_at_the_cap_and_not_before_the_least_spp(self) -> None:
        for spec, expected_spp, spp in (
            (JobSpec(max_spp=300), 500, 300),
            (JobSpec(min_spp=800), None, 800),
            (JobSpec(rule={"name": "fixed", "spp": 600}), None, 600),
        ):
            members = [
                self.DONE,
                member(1, JobState.RENDERING, spp=200, expected_spp=expected_spp, spec=spec),
            ]
            found = summarise("b", members, now=NOW).forecast_end_at
            assert found == NOW + timedelta(seconds=(spp - 200) / 10)

    def test_counts_only_the_time_in_which_anything_was_rendered(self) -> None:
        # Given a job of yesterday, which took a minute too
        early = NOW - timedelta(days=1)
        old = member(
            0, JobState.CONVERGED, spp=600, started_at=early, ended_at=early + timedelta(seconds=60)
        )
        members = [old, member(1, JobState.RENDERING, spp=600, expected_spp=900)]
        found = summarise("b", members, now=NOW).forecast_end_at
        assert found == NOW + timedelta(seconds=30)

    @pytest.mark.parametrize(
        "members",
        [
            [DONE],
            [member(0, JobState.QUEUED)],
            [member(0, JobState.RENDERING, spp=200)],
            [DONE, member(1, JobState.PAUSED, spp=200, expected_spp=500)],
            [DONE, member(1, JobState.QUEUED, held=True)],
        ],
        ids=["all ended", "nothing known", "no forecast yet", "one paused", "one held back"],
    )
    def test_is_not_given_where_nobody_can_say(self, members: list[Member]) -> None:
        assert summarise("b", members, now=NOW).forecast_end_at is None


class TestSteering:
    def test_pauses_what_renders_and_holds_the_rest_back(
        self, client: redis.Redis, jobs: Jobs, batches: Batches
    ) -> None:
        first, second = create(jobs, 2)
        begun, waiting = StagedJob(client, first), StagedJob(client, second)
        begun.commit()
        for staged in (begun, waiting):
            staged.plan()
        queue = SliceQueue(client, "another", lease_s=60)

        def lease() -> str | None:
            found = queue.lease(("scalar_rgb",), None, in_turn=False)
            return None if found is None else found.job_id

        for _ in range(2):
            steered = batches.steer("b", Steer.PAUSE)
            assert [(one.done, one.state) for one in steered] == [
                (True, JobState.PAUSED),
                (True, JobState.QUEUED),
            ]
        # No worker gets any of it, and both say why
        assert lease() is None
        held = jobs.get(second)
        assert (held.held, held.reason) == (True, "paused with its batch by a user")
        assert batches.get("b").held == 1
        assert take_census(client).slices["waiting"] == 0
        # Until it is resumed
        for _ in range(2):
            steered = batches.steer("b", Steer.RESUME)
            assert [(one.done, one.state) for one in steered] == [
                (True, JobState.RENDERING),
                (True, JobState.QUEUED),
            ]
        assert [lease(), lease()] == [first, second]
        assert not jobs.get(second).held
        told = [line.split(" ", 2)[2] for line in jobs.story(second)]
        assert told[1:3] == [
            "queued: paused with its batch by a user",
            "queued: resumed with its batch by a user",
        ]

    def test_a_job_that_is_held_back_is_resumed_alone_too(
        self, jobs: Jobs, batches: Batches
    ) -> None:
        first, second = create(jobs, 2)
        batches.steer("b", Steer.PAUSE)
        assert jobs.resume(first).state is JobState.QUEUED
        assert [jobs.get(job).held for job in (first, second)] == [False, True]
