"""A job's log over HTTP: how each try of a slice ended."""

import httpx
import pytest
import redis

from plateau.farm.ledger.queue import SliceQueue
from tests.service.api.routes.test_jobs import problem
from tests.support.farms.staged_job import StagedJob


@pytest.fixture
def job(client: redis.Redis) -> StagedJob:
    """Slice 0 committed in silence, slice 1 after a death and with a warning."""
    job = StagedJob(client)
    job.commit()
    job.die("the render process was ended by SIGSEGV", said="last words")
    job.commit(said="a warning")
    return job


def test_it_tells_of_every_try(http: httpx.Client, job: StagedJob) -> None:
    entries = http.get(f"/v1/jobs/{job.id}/log").json()["entries"]
    assert [(one["slice"], one["what"], one["text"]) for one in entries] == [
        (0, "committed", ""),
        (1, "died", "last words"),
        (1, "committed", "a warning"),
    ]
    assert [one["worker"] for one in entries] == ["worker-1"] * 3
    assert entries[1]["cause"] == "the render process was ended by SIGSEGV"
    assert [one["seconds"] for one in entries] == [0.5, 0.2, 0.5]
    assert [one["at"] for one in entries] == sorted(one["at"] for one in entries)
    assert http.get(f"/v1/jobs/{job.id}").json()["links"]["log"] == f"/v1/jobs/{job.id}/log"


def test_it_tells_of_one_slice(http: httpx.Client, job: StagedJob) -> None:
    entries = http.get(f"/v1/jobs/{job.id}/log?slice=1").json()["entries"]
    assert [(one["slice"], one["what"]) for one in entries] == [(1, "died"), (1, "committed")]
    # Of one that is only planned, or not even that, there is nothing to tell yet
    assert http.get(f"/v1/jobs/{job.id}/log?slice=7").json() == {"entries": []}


def test_a_slice_that_can_never_be_is_unknown(http: httpx.Client, job: StagedJob) -> None:
    last = job.spec.max_spp // job.spec.slice_spp - 1
    assert http.get(f"/v1/jobs/{job.id}/log?slice={last}").status_code == 200
    found = problem(http.get(f"/v1/jobs/{job.id}/log?slice={last + 1}"), 404, "unknown-slice")
    assert f"no slice {last + 1}" in found["detail"]
    problem(http.get(f"/v1/jobs/{job.id}/log?slice=-1"), 422, "invalid-request")
    problem(http.get(f"/v1/jobs/{job.id}/log?slice=x"), 422, "invalid-request")
    problem(http.get(f"/v1/jobs/{job.id}/log?slice={10**30}"), 422, "invalid-request")


def test_a_job_of_which_nothing_happened_has_an_empty_one(
    http: httpx.Client, client: redis.Redis
) -> None:
    job = StagedJob(client)
    assert http.get(f"/v1/jobs/{job.id}/log").json() == {"entries": []}


def test_it_outlives_the_job(http: httpx.Client, job: StagedJob) -> None:
    job.end()
    job.finish()
    assert len(http.get(f"/v1/jobs/{job.id}/log").json()["entries"]) == 3


def test_it_is_in_the_description(http: httpx.Client) -> None:
    paths = http.get("/openapi.json").json()["paths"]
    assert "404" in paths["/v1/jobs/{job_id}/log"]["get"]["responses"]


def test_an_unfit_worker_is_told_apart(
    http: httpx.Client, job: StagedJob, client: redis.Redis
) -> None:
    job.plan()
    unfit = SliceQueue(client, "worker-2", lease_s=60)
    held = unfit.lease(("scalar_rgb",), None, in_turn=False)
    assert held is not None
    unfit.hand_back(held, cause="no LLVM", unfit=True)
    (entry,) = http.get(f"/v1/jobs/{job.id}/log?slice=2").json()["entries"]
    assert (entry["what"], entry["worker"], entry["cause"]) == ("unfit", "worker-2", "no LLVM")
