"""Notices over HTTP: asked for in a spec, and shown without secrets."""

import httpx
import redis

from plateau.client import Client
from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.api_keys import ApiKeys, KeyLimits, Role
from plateau.farm.ledger.outbox import Outbox
from plateau.farm.model.spec import JobSpec
from plateau.service.notices.targets import Targets
from tests.support.api_calls import problem, submit
from tests.support.farms.live_api import live_http
from tests.support.farms.receiver import SECRET
from tests.support.farms.staged_job import StagedJob

URL = "https://studio.example/hooks/plateau"


def asked(http: httpx.Client, **notice: object) -> httpx.Response:
    return submit(http, spec={"notice": {"url": URL, "secret": SECRET, **notice}})


def test_the_path_is_shown_to_who_asked_for_it_and_to_nobody_else(
    http: httpx.Client, client: redis.Redis
) -> None:
    # Given three keys, and a job of the first whose notice's path is its secret

    def headers(role: Role) -> dict[str, str]:
        key = ApiKeys(client).create(f"a {role.value}", role, KeyLimits())[1]
        return {"Authorization": f"Bearer {key}"}

    owner = headers(Role.SUBMITTER)
    url = "https://hooks.studio.example:8443/services/T0/swordfish?token=swordfish"
    spec = {"notice": {"url": url, "secret": SECRET}, "batch": "tuesday"}
    path = f"/v1/jobs/{submit(http, spec=spec, headers=owner).json()['id']}"
    # Then its owner is shown all of it
    pages = (path, "/v1/jobs", "/v1/jobs?batch=tuesday")
    for page in pages:
        assert url in http.get(page, headers=owner).text, page
    # And others whom it tells, also where they change it: an admin may, and has no need to know
    for other in (headers(Role.SUBMITTER), headers(Role.VIEWER), headers(Role.ADMIN)):
        for page in pages:
            shown = http.get(page, headers=other).text
            assert "swordfish" not in shown, page
            assert '"https://hooks.studio.example:8443/..."' in shown, page
        for page in (f"{path}/events?after=0-0", f"{path}/log"):
            accept = {"Accept": "application/json"}
            assert "swordfish" not in http.get(page, headers={**other, **accept}).text, page
    for answer in (
        http.patch(path, json={"priority": 3}, headers=other),
        http.post(f"{path}/cancel", headers=other),
    ):
        assert answer.is_success, answer.text
        assert "swordfish" not in answer.text
    # And nobody tells the masked one
    masked = {"url": "https://hooks.studio.example:8443/...", "secret": SECRET}
    found = problem(submit(http, spec={"notice": masked}, headers=owner), 422, "invalid-spec")
    assert "name the whole URL" in found["detail"]


def test_what_cannot_be_told_is_refused_with_advice(http: httpx.Client) -> None:
    for notice, field, words in (
        ({"url": "https://127.0.0.1/x"}, "url", "PLATEAU_WEBHOOK_ALLOW"),
        ({"url": "https://[::ffff:10.0.0.1]/"}, "url", "PLATEAU_WEBHOOK_ALLOW"),
        ({"url": "http://studio.example/"}, "url", "use https"),
        ({"url": "file:///etc/passwd"}, "url", "https://host/path"),
        ({"url": URL, "secret": "swordfish-swordfish"}, "secret", "openssl rand"),
        ({"url": URL, "secret": None}, "secret", "openssl rand"),
        ({"url": URL, "name": "x"}, "name", "no such field"),
    ):
        answer = asked(http, **notice)
        found = problem(answer, 422, "invalid-spec")
        assert [one["field"] for one in found["errors"]] == [f"spec.notice.{field}"]
        assert words in found["detail"]
        assert "swordfish" not in answer.text


def test_the_secret_is_in_no_answer(http: httpx.Client, client: redis.Redis) -> None:
    answer = asked(http)
    root = answer.headers["location"]
    found = [answer, http.post(f"{root}/cancel")]
    StagedJob(client, answer.json()["id"]).finish()
    assert Outbox(client).take(30) is not None
    paths = ("", "/events", "/log", "/slices", "/curve")
    found += [http.get(root + path, headers={"Accept": "application/json"}) for path in paths]
    found += [http.get(path) for path in ("/v1/jobs", "/v1/scenes", "/metrics", "/openapi.json")]
    assert len(found) > 10
    for one in found:
        assert SECRET[6:] not in one.text
        assert "secret" not in one.text or one.url.path == "/openapi.json"


def test_the_same_request_with_another_secret_is_another_request(http: httpx.Client) -> None:
    key = {"Idempotency-Key": "once"}
    specs = [
        JobSpec.model_validate({"notice": {"url": URL, "secret": secret}}).as_request()
        for secret in (SECRET, f"whsec_{'A' * 43}=")
    ]
    first = submit(http, spec=specs[0], headers=key)
    assert submit(http, spec=specs[0], headers=key).json()["id"] == first.json()["id"]
    problem(submit(http, spec=specs[1], headers=key), 422, "idempotency-key-reused")


def test_the_farm_s_owner_may_allow_private_receivers(redis_url: str, store: Blobs) -> None:
    # Given an API whose owner allows a network and a host
    with live_http(redis_url, store, webhook_allow=("10.0.0.0/8", "hooks.lab")) as lab:
        for url in ("http://10.1.2.3:8080/x", "https://10.1.2.3/", "http://hooks.lab/"):
            assert asked(lab, url=url).status_code == 201
        for url in ("http://192.168.1.1/", "http://other.lab/", "https://127.0.0.1/"):
            problem(asked(lab, url=url), 422, "invalid-spec")


def test_a_job_that_goes_on_tells_nobody_whom_a_new_one_may_not(
    http: httpx.Client, client: redis.Redis
) -> None:
    job = StagedJob(client, keep_slices=True)
    job.commit(4)
    job.end()
    job.finish()
    path = f"/v1/jobs/{job.id}/again"
    found = http.post(path, json={"notice": {"url": "https://127.0.0.1/", "secret": SECRET}})
    problem(found, 422, "invalid-spec")
    assert http.post(path, json={"notice": {"url": URL, "secret": SECRET}}).status_code == 201


def test_a_job_names_targets_that_the_operator_knows_and_never_sees_their_urls(
    client: redis.Redis, redis_url: str, store: Blobs
) -> None:
    targets = Targets({"ops": "json://127.0.0.1/a-secret", "lead": "slack://b-secret"}, ("ops",))
    with live_http(redis_url, store, targets=targets) as lab:
        assert submit(lab).json()["spec"]["notice"]["targets"] == ["ops"]
        answer = submit(lab, spec={"notice": {"targets": ["lead"]}})
        assert answer.json()["spec"]["notice"]["targets"] == ["lead", "ops"]
        found = problem(submit(lab, spec={"notice": {"targets": ["boss"]}}), 422, "invalid-spec")
        assert found["errors"][0]["field"] == "spec.notice.targets"
        assert "names: lead, ops" in found["detail"]
        named = lab.get("/v1/targets")
        assert named.json() == {"targets": ["lead"], "always": ["ops"]}
        with Client(str(lab.base_url)) as ours:
            assert ours.targets().targets == ["lead"]
        assert "secret" not in found["detail"] + answer.text + named.text
