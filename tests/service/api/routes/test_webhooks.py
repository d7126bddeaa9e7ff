"""Webhooks over HTTP: asked for in a spec, listed with their tries, sent again; without secrets."""

from collections.abc import Iterator

import httpx
import pytest
import redis

from plateau.client import Client
from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.api_keys import ApiKeys, KeyLimits, Role
from plateau.farm.ledger.outbox import Outbox, new_secret
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.spec.webhook import DEFAULT_EVENTS
from plateau.farm.process.notify_targets import Targets
from tests.service.api.routes.test_jobs import problem, submit
from tests.support.farms.live_api import live_api
from tests.support.farms.staged_job import StagedJob

URL = "https://studio.example/hooks/plateau"


def asked(http: httpx.Client, **webhook: object) -> httpx.Response:
    return submit(http, spec={"webhook": {"url": URL, **webhook}})


def test_a_job_shows_whom_it_tells(http: httpx.Client) -> None:
    job = asked(http, events=["finished"]).json()
    assert job["spec"]["webhook"] == {"url": URL, "events": ["finished"]}
    assert job["links"]["webhooks"] == f"/v1/jobs/{job['id']}/webhooks"
    # All changes but the first, where nothing is said
    assert asked(http).json()["spec"]["webhook"]["events"] == list(DEFAULT_EVENTS)


def test_the_path_is_shown_to_who_asked_for_it_and_to_nobody_else(
    http: httpx.Client, client: redis.Redis
) -> None:
    # Given three keys, and a job of the first whose webhook's path is its secret
    limits = KeyLimits(requests_per_minute=6000, burst=100, upload_bytes=None, open_jobs=None)

    def headers(role: Role) -> dict[str, str]:
        key = ApiKeys(client).create(f"a {role.value}", role, limits)[1]
        return {"Authorization": f"Bearer {key}"}

    owner = headers(Role.SUBMITTER)
    url = "https://hooks.studio.example:8443/services/T0/swordfish?token=swordfish"
    spec = {"webhook": {"url": url, "events": ["queued"]}, "batch": "tuesday"}
    path = f"/v1/jobs/{submit(http, spec=spec, headers=owner).json()['id']}"
    # Then its owner is shown all of it
    pages = (path, "/v1/jobs", "/v1/jobs?batch=tuesday", f"{path}/webhooks")
    for page in pages:
        assert url in http.get(page, headers=owner).text, page
    # And others whom it tells, also where they change it: an admin may, and has no need to know
    for other in (headers(Role.SUBMITTER), headers(Role.VIEWER), headers(Role.ADMIN)):
        for page in pages:
            shown = http.get(page, headers=other).text
            assert "swordfish" not in shown, page
            assert '"https://hooks.studio.example:8443/..."' in shown, page
        for page in (f"{path}/events?after=0-0", f"{path}/report.html", f"{path}/log"):
            accept = {"Accept": "application/json, text/html"}
            assert "swordfish" not in http.get(page, headers={**other, **accept}).text, page
    for answer in (
        http.patch(path, json={"priority": 3}, headers=other),
        http.post(f"{path}/webhooks/1/redeliver", headers=other),
        http.post(f"{path}/cancel", headers=other),
    ):
        assert answer.is_success, answer.text
        assert "swordfish" not in answer.text
    # And nobody tells the masked one
    masked = {"url": "https://hooks.studio.example:8443/..."}
    found = problem(submit(http, spec={"webhook": masked}, headers=owner), 422, "invalid-spec")
    assert "name the whole URL" in found["detail"]


def test_a_webhook_of_nobody_s_job_is_shown_to_nobody_once_there_are_keys(
    http: httpx.Client, client: redis.Redis
) -> None:
    path = f"/v1/jobs/{asked(http).json()['id']}"
    assert URL in http.get(path).text
    limits = KeyLimits(requests_per_minute=60, burst=10, upload_bytes=None, open_jobs=None)
    key = ApiKeys(client).create("an admin", Role.ADMIN, limits)[1]
    shown = http.get(path, headers={"Authorization": f"Bearer {key}"}).json()
    assert shown["spec"]["webhook"]["url"] == "https://studio.example/..."


@pytest.mark.parametrize(
    ("webhook", "field", "words"),
    [
        ({"url": "https://127.0.0.1/x"}, "spec.webhook.url", "PLATEAU_WEBHOOK_ALLOW"),
        ({"url": "https://localhost:8443/"}, "spec.webhook.url", "PLATEAU_WEBHOOK_ALLOW"),
        ({"url": "https://[::ffff:10.0.0.1]/"}, "spec.webhook.url", "PLATEAU_WEBHOOK_ALLOW"),
        ({"url": "https://0x7f.1/"}, "spec.webhook.url", "PLATEAU_WEBHOOK_ALLOW"),
        ({"url": "http://studio.example/"}, "spec.webhook.url", "use https"),
        ({"url": "https://me:word@studio.example/"}, "spec.webhook.url", "no user"),
        ({"url": "file:///etc/passwd"}, "spec.webhook.url", "https://host/path"),
        ({"url": URL, "secret": "swordfish-swordfish"}, "spec.webhook.secret", "openssl rand"),
        ({"url": URL, "events": ["done"]}, "spec.webhook.events.0", "finished"),
        ({"url": URL, "name": "x"}, "spec.webhook.name", "no such field"),
        ({}, "spec.webhook.url", "is missing"),
    ],
)
def test_what_cannot_be_told_is_refused_with_advice(
    http: httpx.Client, webhook: dict[str, object], field: str, words: str
) -> None:
    answer = submit(http, spec={"webhook": webhook})
    found = problem(answer, 422, "invalid-spec")
    assert [one["field"] for one in found["errors"]] == [field]
    assert words in found["detail"]
    assert "swordfish" not in answer.text


def test_the_secret_is_in_no_answer(http: httpx.Client, client: redis.Redis) -> None:
    secret = new_secret()
    answer = asked(http, secret=secret, events=["queued", "cancelled"])
    root = answer.headers["location"]
    Outbox(client).take(30)
    found = [answer, http.post(f"{root}/cancel")]
    paths = ("", "/events", "/webhooks", "/log", "/slices", "/curve", "/report.html")
    found += [http.get(root + path, headers={"Accept": "application/json"}) for path in paths]
    found += [http.get(path) for path in ("/v1/jobs", "/v1/scenes", "/metrics", "/openapi.json")]
    assert len(found) > 10
    for one in found:
        assert secret[6:] not in one.text
        assert "secret" not in one.text or one.url.path == "/openapi.json"


def test_the_same_request_with_another_secret_is_another_request(http: httpx.Client) -> None:
    key = {"Idempotency-Key": "once"}
    specs = [
        JobSpec.model_validate({"webhook": {"url": URL, "secret": new_secret()}}).as_request()
        for _ in range(2)
    ]
    first = submit(http, spec=specs[0], headers=key)
    assert submit(http, spec=specs[0], headers=key).json()["id"] == first.json()["id"]
    problem(submit(http, spec=specs[1], headers=key), 422, "idempotency-key-reused")


def test_each_delivery_is_listed_with_its_tries(http: httpx.Client, client: redis.Redis) -> None:
    job = asked(http, events=["queued", "cancelled"]).json()
    path = f"/v1/jobs/{job['id']}/webhooks"
    http.post(f"/v1/jobs/{job['id']}/cancel")
    outbox = Outbox(client)
    taken = outbox.take(30)
    assert taken is not None
    error = "the receiver answered 500"
    outbox.settle(taken, "failed", status=500, error=error, took_s=0.012, delay_s=60)
    listed = http.get(path).json()
    assert (listed["url"], listed["events"]) == (URL, ["queued", "cancelled"])
    first, second = listed["deliveries"]
    assert (first["number"], first["id"], first["event"]) == (1, f"msg_{job['id']}_1", "queued")
    assert first["state"] == "waiting"
    assert first["next_try_at"] > first["at"]
    [tried] = first["tries"]
    assert (tried["status"], tried["error"], tried["ms"]) == (500, error, 12)
    assert (second["event"], second["tries"]) == ("cancelled", [])


def test_one_can_be_sent_again(http: httpx.Client, client: redis.Redis) -> None:
    job = asked(http, events=["queued"]).json()
    path = f"/v1/jobs/{job['id']}/webhooks"
    outbox = Outbox(client)
    taken = outbox.take(30)
    assert taken is not None
    outbox.settle(taken, "given-up", status=410, error="gone", took_s=0.1)
    answer = http.post(f"{path}/1/redeliver")
    assert answer.status_code == 202
    assert answer.json()["state"] == "waiting"
    again = outbox.take(30)
    assert again is not None
    assert again.id == taken.id
    # Where there is none
    found = problem(http.post(f"{path}/2/redeliver"), 404, "unknown-delivery")
    assert path in found["detail"]
    problem(http.post(f"{path}/0/redeliver"), 422, "invalid-request")
    problem(http.post("/v1/jobs/000000000000/webhooks/1/redeliver"), 404, "unknown-job")


def test_a_job_without_a_webhook_has_none(http: httpx.Client, client: redis.Redis) -> None:
    job = StagedJob(client)
    answer = http.get(f"/v1/jobs/{job.id}/webhooks")
    assert answer.json() == {"url": None, "events": [], "deliveries": []}
    problem(http.get("/v1/jobs/000000000000/webhooks"), 404, "unknown-job")


@pytest.fixture
def lab(redis_url: str, store: Blobs) -> Iterator[httpx.Client]:
    """An API whose owner allows a network and a host."""
    with (
        live_api(redis_url, store, webhook_allow=("10.0.0.0/8", "hooks.lab")) as url,
        httpx.Client(base_url=url, trust_env=False, timeout=20) as http,
    ):
        yield http


def test_the_farm_s_owner_may_allow_private_receivers(lab: httpx.Client) -> None:
    for url in ("http://10.1.2.3:8080/x", "https://10.1.2.3/", "http://hooks.lab/"):
        assert submit(lab, spec={"webhook": {"url": url}}).status_code == 201
    for url in ("http://192.168.1.1/", "http://other.lab/", "https://127.0.0.1/"):
        problem(submit(lab, spec={"webhook": {"url": url}}), 422, "invalid-spec")


def test_a_job_that_goes_on_tells_nobody_whom_a_new_one_may_not(
    http: httpx.Client, client: redis.Redis
) -> None:
    job = StagedJob(client, keep_slices=True)
    job.commit(4)
    job.end()
    job.finish()
    path = f"/v1/jobs/{job.id}/continue"
    found = http.post(path, json={"webhook": {"url": "https://127.0.0.1/"}})
    problem(found, 422, "invalid-spec")
    assert http.post(path, json={"webhook": {"url": URL}}).status_code == 201


def test_the_api_s_description_has_what_is_sent(http: httpx.Client) -> None:
    document = http.get("/openapi.json").json()
    [(_, operations)] = document["webhooks"].items()
    body = operations["post"]["requestBody"]["content"]["application/json"]["schema"]
    assert body == {"$ref": "#/components/schemas/WebhookMessage"}
    assert set(operations["post"]["responses"]) == {"204"}
    secret = document["components"]["schemas"]["WebhookSpec"]["properties"]["secret"]
    assert secret["anyOf"][0]["writeOnly"] is True


def test_a_job_names_targets_that_the_operator_knows_and_never_sees_their_urls(
    client: redis.Redis, redis_url: str, store: Blobs
) -> None:
    targets = Targets({"ops": "json://127.0.0.1/a-secret", "lead": "slack://b-secret"}, ("ops",))
    with (
        live_api(redis_url, store, targets=targets) as url,
        httpx.Client(base_url=url) as lab,
    ):
        assert submit(lab).json()["spec"]["notify"] == ["ops"]
        answer = submit(lab, spec={"notify": ["lead"]})
        assert answer.json()["spec"]["notify"] == ["lead", "ops"]
        found = problem(submit(lab, spec={"notify": ["boss"]}), 422, "invalid-spec")
        assert found["errors"][0]["field"] == "spec.notify"
        assert "names: lead, ops" in found["detail"]
        named = lab.get("/v1/targets")
        assert named.json() == {"targets": ["lead"], "always": ["ops"]}
        with Client(url) as ours:
            assert ours.targets().targets == ["lead"]
        assert "secret" not in found["detail"] + answer.text + named.text
