"""The API, attacked by what its own OpenAPI document says of it.

Schemathesis derives requests from the document: its examples, the boundaries of each parameter,
methods that are not there, and random requests, valid and invalid. Each goes to a live API over a
real Redis that has jobs in several states. No answer may be a 5xx, and each has to be as the
document says: its status, content type, headers and schema. What is invalid has to be refused.

Left out are

- streams of events, which have no end: `/events` is asked for what has happened so far;
- that what the document allows is accepted (`positive_data_acceptance`): whether a scene can be
  rendered, a step is a number of slices or a job exists is more than a schema can say;
- keys: `access/test_keys.py` asks each call without one.

FUZZ_SEED sets the seed, LONG_TESTS=1 asks for many more requests. Of calls that take the same,
`make test` asks one.
"""

import copy
import inspect
import os
import zlib
from collections.abc import Callable, Mapping
from typing import Final
from urllib.parse import parse_qs, urlsplit

import pytest
import redis
import requests
import schemathesis
from hypothesis import HealthCheck, settings
from schemathesis.checks import load_all_checks
from schemathesis.config import (
    ChecksConfig,
    GenerationConfig,
    PositiveDataAcceptanceConfig,
    ProjectConfig,
    ProjectsConfig,
    SchemathesisConfig,
)
from schemathesis.core.parameters import ParameterLocation
from schemathesis.pytest.lazy import get_all_tests

from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.model.states import JobState
from tests.support import long_tests
from tests.support.api_document import api_document
from tests.support.farms.staged_job import PARTIAL, StagedJob
from tests.support.long_tests import rare_among

SEED = int(os.environ.get("FUZZ_SEED", "20261121"))
REQUESTS = 1000 if long_tests.WANTED else 10  #: random ones for each operation, at most


@pytest.fixture
def job_ids(client: redis.Redis, api_store: Blobs) -> list[str]:
    """Jobs that wait, render, are paused, have failed, and have converged with all results."""
    print(f"FUZZ_SEED={SEED}")
    queued, rendering, paused, failed, finished = (
        StagedJob(client, keep_slices=True, batch="exposures", slice_spp=100) for _ in range(5)
    )
    for job in (rendering, paused, finished):
        job.commit(2, said="WARN: unused parameter")
        api_store.put(job.slice_blob(0), PARTIAL)
        job.point(100, 0)
        job.point(200, 30, slope=0.25)
        for name in ("image.png", "image.exr", "difference.png"):
            job.picture(api_store, name, b"picture")
    Jobs(client).pause(paused.id)
    failed.end(JobState.FAILED, "no plugin of that name")
    finished.end()
    finished.finish()
    return [job.id for job in (queued, rendering, paused, failed, finished)]


DOCUMENT = api_document()
OPERATIONS = [
    f"{method.upper()} {path}" for path, item in DOCUMENT["paths"].items() for method in item
]

#: Those whose requests hold a whole spec, and those that take what another call takes too.
_DEAR = {
    *("POST /v1/jobs", "POST /v1/scenes", "POST /v1/jobs/{job_id}/again"),
    *(
        f"GET /v1/jobs/{{job_id}}/{name}"
        for name in (
            *("image.png", "image.exr", "difference.png", "noise.png", "quality.png", "spp.png"),
            *("non-finite.png", "curve.csv", "log", "slices", "previews"),
            "results.zip",
        )
    ),
    *(f"POST /v1/jobs/{{job_id}}/{call}" for call in ("pause", "resume", "restore")),
    *(f"POST /v1/batches/{{name}}/{call}" for call in ("pause", "resume", "restore")),
    "GET /v1/batches/{name}/shot/film.png",
    *("POST /v1/workers/{worker_id}/resume", "GET /v1/usage.csv"),
}


@pytest.fixture(scope="module")
def open_api() -> schemathesis.BaseSchema:
    """The API's description, with how much is asked of it and nothing of keys."""
    project = ProjectConfig(
        generation=GenerationConfig(max_examples=REQUESTS, database="none"),
        checks=ChecksConfig(positive_data_acceptance=PositiveDataAcceptanceConfig(enabled=False)),
    )
    config = SchemathesisConfig(seed=SEED, projects=ProjectsConfig(default=project))
    document = copy.deepcopy(DOCUMENT)
    for operations in document["paths"].values():
        for operation in operations.values():
            operation.pop("security", None)
    return schemathesis.openapi.from_dict(document, config=config)


#: What `get_all_tests` asked for in the last schemathesis that Python 3.10 has, and does no more.
_ASKED_BEFORE: Final = dict.fromkeys(
    {"seed", "as_strategy_kwargs"} & inspect.signature(get_all_tests).parameters.keys()
)


def each_request_to(
    operation: str, schema: schemathesis.BaseSchema, send: Callable[[schemathesis.Case], None]
) -> None:
    """Make up the requests to this call, and send each.

    As `schema.parametrize()` does, but where they are sent: with `-n` every process collects all
    tests, and to make up all requests takes it ten seconds.
    """
    load_all_checks()
    [made] = get_all_tests(
        schema=schema.include(name=operation),
        test_func=send,
        settings=settings(deadline=None, suppress_health_check=list(HealthCheck)),
        given_kwargs=None,
        **_ASKED_BEFORE,
    )
    _, test = made.ok()
    test()


@pytest.mark.parametrize("operation", rare_among(OPERATIONS, _DEAR))
def test_no_request_breaks_the_api(
    operation: str, open_api: schemathesis.BaseSchema, session_api: str, job_ids: list[str]
) -> None:
    def send(case: schemathesis.Case) -> None:
        attack(case, session_api, job_ids)

    each_request_to(operation, open_api, send)


def attack(case: schemathesis.Case, url: str, job_ids: list[str]) -> None:
    name_a_real_job(case, job_ids)
    if case.path.endswith("/events"):
        case.headers["Accept"] = "application/json"
    # Schemathesis judges what it drew. Let that be what is sent: lists as text.
    case.query.update(lists_as_sent(case.query))
    case.call_and_validate(base_url=url, timeout=60)


def lists_as_sent(query: Mapping[str, object]) -> dict[str, list[str]]:
    """The texts that the URL has of each list: of `["true", [], {}]` it has `true` alone."""
    lists = {name: value for name, value in query.items() if isinstance(value, list)}
    url = str(requests.Request("GET", "http://host", params=lists).prepare().url)
    sent = parse_qs(urlsplit(url).query, keep_blank_values=True)
    return {name: sent.get(name, []) for name in lists}


def name_a_real_job(case: schemathesis.Case, job_ids: list[str]) -> None:
    """Let five of six requests for a job be for one that exists, unless its id is the attack."""
    meta = case.meta
    if meta is None or case.path_parameters.get("job_id") in (None, *job_ids):
        return
    path = meta.components.get(ParameterLocation.PATH)
    if path is not None and path.mode.is_negative:
        return
    drawn = repr((case.method, case.path_parameters, case.query, dict(case.headers)))
    number = zlib.crc32(drawn.encode(errors="backslashreplace")) % (len(job_ids) + 1)
    if number < len(job_ids):
        case.path_parameters["job_id"] = job_ids[number]
