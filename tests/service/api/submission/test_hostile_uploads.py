"""Hostile uploads through the real API: a problem in words or a job, and never its end.

They are drawn as in `tests/farm/bundle/test_bundle_fuzz.py`, from ``FUZZ_SEED``.
"""

import json
import os
import time
from collections import Counter

import httpx
import pytest
from hypothesis import HealthCheck, given, seed, settings

from plateau.farm.bundle import CODES
from tests.support import long_tests
from tests.support.scenes.bundle_strategies import Upload, uploads
from tests.support.scenes.bundles import scene

SEED = int(os.environ.get("FUZZ_SEED", "0"))
CASES = 2000 if long_tests.WANTED else 150
#: Generous: an answer takes milliseconds on a quiet machine.
MOST_S = 20.0

GOOD = scene(
    sensor='<sensor type="perspective"><film type="hdrfilm">'
    '<integer name="width" value="9"/><integer name="height" value="9"/></film></sensor>'
)


def post(http: httpx.Client, content: bytes, spec: dict[str, object]) -> httpx.Response:
    files = {"scene": ("scene", content), "spec": (None, json.dumps(spec))}
    return http.post("/v1/jobs", files=files, timeout=MOST_S)


@pytest.mark.timeout(3600)
def test_every_upload_is_answered_and_the_next_good_one_accepted(http: httpx.Client) -> None:
    answers: Counter[int] = Counter()

    @seed(SEED)
    @settings(
        max_examples=CASES, deadline=None, database=None, suppress_health_check=list(HealthCheck)
    )
    @given(upload=uploads())
    def check(upload: Upload) -> None:
        started = time.monotonic()
        spec = {"parameters": upload.parameters, "sensor": upload.sensor}
        answer = post(http, upload.content, spec)
        assert time.monotonic() - started < MOST_S
        answers[answer.status_code] += 1
        if answer.status_code == 201:
            assert answer.json()["state"] == "queued"
            return
        assert 400 <= answer.status_code < 500, answer.text
        assert answer.headers["content-type"] == "application/problem+json"
        problem = answer.json()
        assert problem["status"] == answer.status_code
        assert problem["detail"]
        if problem["type"] == "/problems/broken-scene":
            assert problem["code"] in CODES

    print(f"FUZZ_SEED={SEED}")
    check()
    assert post(http, GOOD, {}).status_code == 201
    assert http.get("/readyz").status_code == 200
    # And some of them got as far as a job
    assert answers[201] > CASES / 100
    assert answers[422] > CASES / 2
