"""What jobs cost, and their sums over HTTP, in the client and on the command line."""

import csv
import json
from datetime import date
from functools import partial

import httpx
import pytest
import redis

from plateau.client import Client
from plateau.farm.ledger import usage as ledger
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.states import JobState
from plateau.farm.redis import keys
from plateau.farm.wire.usage_views import usage_csv
from tests.support.api_calls import problem
from tests.support.farms.staged_job import HEIGHT, WIDTH, StagedJob
from tests.support.processes.commands import plateau as command

#: 2026-11-02 was a Monday: ISO week 45.
_MONDAY_MS = 1_793_577_600_000
_WEEK_MS = 7 * 86_400_000
SLICE_H = 0.5 / 3600  # a staged slice takes one core half a second


@pytest.fixture
def jobs(client: redis.Redis) -> list[StagedJob]:
    """Jobs of 1, 2 and 4 slices: two in a batch, the last a week later."""
    made = [StagedJob(client, batch="walk"), StagedJob(client, batch="walk"), StagedJob(client)]
    for number, job in enumerate(made):
        job.commit(2**number)
        at = _MONDAY_MS + (_WEEK_MS if number == 2 else 0)
        client.hset(keys.job(job.id), "created_at", at)
    client.hset(keys.job(made[2].id, "sealed"), mapping={"owner": "k1", "owner_name": "anna"})
    return made


def sums(http: httpx.Client, **asked: str | int) -> dict[str, float]:
    """The slices that each row is worth."""
    found = http.get("/v1/usage", params=asked).raise_for_status().json()
    assert found["total"]["core_hours"] >= sum(row["core_hours"] for row in found["rows"]) - 1e-5
    return {row["key"]: round(row["core_hours"] / SLICE_H, 1) for row in found["rows"]}


def test_jobs_are_summed_by_what_is_asked(http: httpx.Client, jobs: list[StagedJob]) -> None:
    first, second, third = (job.id for job in jobs)
    assert list(sums(http, by="job")) == [third, second, first]
    assert sums(http, by="batch") == {"": 4, "walk": 3}
    assert sums(http, by="owner") == {"k1": 4, "": 3}
    assert sums(http) == sums(http, by="week") == {"2026-W45": 3, "2026-W46": 4}


def test_many_jobs_are_read_in_portions(
    http: httpx.Client, jobs: list[StagedJob], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ledger, "_AT_ONCE", 1)
    assert sums(http, by="batch") == {"": 4, "walk": 3}
    assert sums(http, by="job", limit=1) == {jobs[2].id: 4}
    assert http.get("/v1/usage?by=job&limit=1").json()["left_out"] == 2


def test_a_time_leaves_out_what_was_submitted_outside(
    http: httpx.Client, jobs: list[StagedJob]
) -> None:
    assert sums(http, since="2026-11-09") == {"2026-W46": 4}
    assert sums(http, until="2026-11-09T00:00:00Z") == {"2026-W45": 3}
    assert sums(http, since="2026-11-02T01:00+01:00", until="2026-11-03") == {"2026-W45": 3}
    assert sums(http, since="2026-11-10") == {}
    assert sums(http, since="0001-01-01T00:00+23:59", until="9999-12-31T23:59-23:59")


@pytest.mark.parametrize(
    ("asked", "says"),
    [
        ({"by": "month"}, "by"),
        ({"since": "2026-13-01"}, "since: 2026-13-01 is no time"),
        ({"since": "yesterday"}, "since"),
        ({"since": "2026-11-02", "until": "2026-11-01"}, "until: it has to be later than since"),
        ({"limit": "0"}, "limit"),
    ],
)
def test_what_cannot_be_asked_is_a_problem(http: httpx.Client, asked: dict, says: str) -> None:
    assert says in problem(http.get("/v1/usage", params=asked), 422, "invalid-request")["detail"]


def test_a_job_says_what_was_spent_and_saved(
    http: httpx.Client, client: redis.Redis, jobs: list[StagedJob]
) -> None:
    jobs[2].end(JobState.CONVERGED)
    job = http.get(f"/v1/jobs/{jobs[2].id}").json()
    assert job["core_hours"] == pytest.approx(4 * SLICE_H, rel=1e-4)
    saved_slices = job["samples_saved"] / (WIDTH * HEIGHT * job["spec"]["slice_spp"])
    assert job["saved_core_hours"] == pytest.approx(saved_slices * SLICE_H, rel=1e-4)
    assert saved_slices > 0
    total = http.get("/v1/usage").json()["total"]
    assert (total["jobs"], total["core_hours"]) == (3, pytest.approx(7 * SLICE_H, abs=1e-5))


def test_no_name_is_a_formula_of_a_spreadsheet(session_api: str, client: redis.Redis) -> None:
    Jobs(client).create(JobSpec(), name="=1+1", scene_sha256="00")
    with Client(session_api) as plateau:
        [row] = csv.DictReader(usage_csv(plateau.usage("job")).splitlines())
    assert row["name"] == "'=1+1"


def test_the_client_asks_by_dates(session_api: str, jobs: list[StagedJob]) -> None:
    with Client(session_api) as plateau:
        found = plateau.usage("batch", since=date(2026, 11, 1), until="2026-11-08")
        assert [(row.key, row.jobs) for row in found.rows] == [("walk", 2)]
        assert len(plateau.usage("batch", limit=1).rows) == 1


def test_the_command_line_prints_a_table_csv_or_json(
    session_api: str, jobs: list[StagedJob]
) -> None:
    plateau = partial(command, PLATEAU_URL=session_api)
    code, out, err = plateau("usage", "--by", "batch", "--until", "2026-11-08")
    assert (code, out.split("\t")[:4]) == (0, ["walk", "–", "2", "0.000417"])
    assert "2 jobs: 0.000417 core hours" in err
    [head, *rows] = plateau("usage", "--by", "owner", "--csv")[1].splitlines()
    assert head.startswith("key,name,jobs,")
    assert [row.rsplit(",", 4)[0] for row in rows] == ["k1,anna,1", ",,2"]
    assert json.loads(plateau("usage", "--json")[1])["total"]["jobs"] == 3
    assert plateau("usage", "--csv", "--json")[0] == plateau("usage", "--by", "month")[0] == 2
    assert "until" in plateau("usage", "--since", "2026-11-02", "--until", "2026-11-01")[2]
    assert "cost:       0.000139 core hours" in plateau("show", jobs[0].id)[1]
