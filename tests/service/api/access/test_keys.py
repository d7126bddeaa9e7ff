"""Who may call the API: with which key, as what, how often, and for whose jobs."""

import socket
from collections.abc import Callable, Iterator

import httpx
import pytest
import redis

from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.api_keys import ApiKeys, KeyLimits, Role
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.model.states import JobState
from plateau.service.api.access.key_guard import Access, needs_key
from plateau.service.api.process import CannotListen, access_at
from plateau.service.api.routes import results as routes_results
from tests.support.api_calls import BOX, problem, submit
from tests.support.farms.live_api import http_client, live_http
from tests.support.farms.staged_job import StagedJob
from tests.support.processes.commands import starting

As = Callable[..., httpx.Client]


@pytest.fixture
def as_(session_api: str, keys: ApiKeys) -> Iterator[As]:
    """Clients of the session's API, each with a new key of this role and these limits."""

    def with_key(role: str, **limits: float | None) -> httpx.Client:
        _, shown = keys.create(f"a {role}", Role(role), KeyLimits.model_validate(limits))
        return http_client(session_api, Authorization=f"Bearer {shown}")

    yield from starting(with_key)


def id_of(client: httpx.Client) -> str:
    return client.headers["Authorization"].split("_")[1]


def shown_by(client: httpx.Client) -> str:
    return client.headers["Authorization"].removeprefix("Bearer ")


class TestAnOpenApi:
    def test_wants_no_key_as_long_as_none_was_made(self, http: httpx.Client) -> None:
        assert http.get("/v1/jobs").status_code == 200
        made = submit(http).json()
        assert (made["owner"], made["owner_name"]) == (None, None)
        # Nor does it mind one, as of a client that has another service's
        answer = http.get("/v1/jobs", headers={"Authorization": "Bearer plateau_0_0"})
        assert answer.status_code == 200

    def test_is_closed_by_the_first_key_and_not_opened_by_revoking_them_all(
        self, http: httpx.Client, as_: As, keys: ApiKeys
    ) -> None:
        assert http.get("/v1/jobs").status_code == 200
        viewer = as_("viewer")
        problem(http.get("/v1/jobs"), 401, "no-key")
        assert viewer.get("/v1/jobs").status_code == 200
        keys.revoke(id_of(viewer))
        problem(viewer.get("/v1/jobs"), 401, "bad-key")
        problem(http.get("/v1/jobs"), 401, "no-key")


def test_elsewhere_than_on_this_machine_it_wants_a_key_that_can_be_used(keys: ApiKeys) -> None:
    assert access_at("127.0.0.1", keys, open_to_all=False) is Access.UNTIL_KEYS
    assert access_at("::1", keys, open_to_all=True) is Access.OPEN
    for host in ("0.0.0.0", "example.org", ""):
        with pytest.raises(CannotListen, match="plateau keys create NAME --role admin"):
            access_at(host, keys, open_to_all=False)
        key, _ = keys.create(f"me at {host}", Role.ADMIN, KeyLimits())
        assert access_at(host, keys, open_to_all=False) is Access.KEYS
        with pytest.raises(CannotListen, match="with --open: other machines reach that address"):
            access_at(host, keys, open_to_all=True)
        keys.revoke(key.id)


class TestAKey:
    def test_is_wanted_for_all_that_is_the_farm_s(self, http: httpx.Client, as_: As) -> None:
        as_("viewer")
        described = http.get("/openapi.json").json()
        paths = [path for path in described["paths"] if needs_key(path)]
        ours = {"/healthz", "/readyz", "/v1/rules", "/v1/spec", "/problems/{slug}"}
        assert set(described["paths"]) - set(paths) == ours
        for path in paths:
            for method, operation in described["paths"][path].items():
                asked = path.replace("{", "").replace("}", "")
                answer = http.request(method, asked)
                assert answer.headers["www-authenticate"] == 'Bearer realm="plateau"'
                assert "plateau keys create" in problem(answer, 401, "no-key")["detail"]
                assert operation["security"] == [{"api_key": []}]
        # Not even what is not there is told
        problem(http.get("/v1/nothing"), 401, "no-key")

    def test_can_ask_what_it_may_do(self, http: httpx.Client, as_: As) -> None:
        nobody = {"id": None, "name": None, "role": "admin", "limits": None}
        assert http.get("/v1/key").json() == nobody  # as long as the service is open
        mine = as_("submitter", open_jobs=7)
        told = mine.get("/v1/key").json()
        assert (told["id"], told["name"], told["role"]) == (id_of(mine), "a submitter", "submitter")
        assert told["limits"]["open_jobs"] == 7
        assert set(told) == set(nobody)
        problem(http.get("/v1/key"), 401, "no-key")

    def test_revoked_ends_a_stream_of_events_that_is_open(
        self, as_: As, keys: ApiKeys, client: redis.Redis, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(routes_results, "_HEARTBEAT_S", 0.1)
        job = StagedJob(client)
        revoked, other = as_("viewer"), as_("viewer")
        with (
            revoked.stream("GET", f"/v1/jobs/{job.id}/events") as stream,
            other.stream("GET", f"/v1/jobs/{job.id}/events") as others,
        ):
            lines, goes_on = stream.iter_lines(), others.iter_lines()
            assert ": still here" in lines
            keys.revoke(id_of(revoked))
            assert len(list(lines)) < 1000  # it ends
            assert [": still here" in goes_on for _ in range(5)] == [True] * 5

    def test_unknown_or_revoked_is_answered_alike(self, as_: As, keys: ApiKeys) -> None:
        revoked, viewer = as_("viewer"), as_("viewer")
        keys.revoke(id_of(revoked))
        secret = shown_by(viewer).rpartition("_")[2]
        answers = [
            revoked.get("/v1/jobs"),
            *(
                viewer.get(
                    "/v1/jobs", headers={b"Authorization": f"Bearer {forged}".encode("latin-1")}
                )
                for forged in (
                    f"plateau_{id_of(viewer)}_{'0' * 64}",
                    f"plateau_{'0' * 12}_{secret}",
                    "rubbish",
                    "a b",
                    "\xe9",
                )
            ),
        ]
        for answer in answers:
            said = problem(answer, 401, "bad-key")
            assert said == problem(answers[0], 401, "bad-key")
            assert 'error="invalid_token"' in answer.headers["www-authenticate"]
            assert secret not in answer.text

    def test_is_read_as_http_writes_it(self, as_: As) -> None:
        viewer = as_("viewer")
        for scheme in ("Bearer ", "bearer ", "BEARER   "):
            headers = {"Authorization": scheme + shown_by(viewer)}
            assert viewer.get("/v1/jobs", headers=headers).status_code == 200
        for sent in ("", "Bearer", "Basic bWU6"):
            problem(viewer.get("/v1/jobs", headers={"Authorization": sent}), 401, "no-key")
        # And lets the service have any name
        foreign = {"Host": "farm.example", "Origin": "https://a.example", "X-Real-IP": "10.1.2.3"}
        assert viewer.get("/v1/jobs", headers=foreign).status_code == 200

    def test_answers_before_an_upload_has_come(self, http: httpx.Client, as_: As) -> None:
        as_("viewer")
        url = http.base_url
        with socket.create_connection((url.host, url.port or 80), timeout=60) as fresh:
            fresh.sendall(
                b"POST /v1/jobs HTTP/1.1\r\nHost: localhost\r\nContent-Length: 2000000\r\n\r\n"
            )
            assert fresh.recv(65536).startswith(b"HTTP/1.1 401 ")


class TestARole:
    def test_of_a_viewer_is_to_look(self, as_: As, client: redis.Redis) -> None:
        job = StagedJob(client)
        viewer = as_("viewer")
        for path in ("/v1/jobs", f"/v1/jobs/{job.id}", "/v1/workers", "/v1/scenes", "/metrics"):
            assert viewer.get(path).status_code == 200
        assert viewer.head(f"/v1/jobs/{job.id}").status_code == 200
        for refused in (
            submit(viewer),
            viewer.post(f"/v1/jobs/{job.id}/cancel"),
            viewer.patch(f"/v1/jobs/{job.id}", json={"priority": 1}),
            viewer.post("/v1/batches/none/cancel"),
        ):
            said = problem(refused, 403, "role-too-low")
            assert (said["role"], said["needed"]) == ("viewer", "submitter")
            assert "--role submitter" in said["detail"]
            assert 'error="insufficient_scope"' in refused.headers["www-authenticate"]
        # A worker is steered by an admin alone
        for role, status in (("viewer", 403), ("submitter", 403), ("admin", 404)):
            assert as_(role).post("/v1/workers/none/drain").status_code == status

    def test_of_a_submitter_is_to_steer_its_own_jobs(self, as_: As, client: redis.Redis) -> None:
        mine, yours = as_("submitter"), as_("submitter")
        job = submit(mine).json()
        assert (job["owner"], job["owner_name"]) == (id_of(mine), "a submitter")
        nobodys = StagedJob(client).id
        found = yours.get("/v1/jobs", params={"owner": id_of(mine)}).json()["jobs"]
        assert [one["id"] for one in found] == [job["id"]]
        path = f"/v1/jobs/{job['id']}"
        # Everybody may look
        assert yours.get(path).json()["owner"] == id_of(mine)
        for steered in (path, f"/v1/jobs/{nobodys}"):
            for answer in (
                yours.patch(steered, json={"priority": 1}),
                yours.post(f"{steered}/cancel"),
                yours.post(f"{steered}/pause"),
                yours.post(f"{steered}/resume"),
                yours.post(f"{steered}/again", json={}),
                yours.request("DELETE", f"{steered}/anything/to/come"),
            ):
                assert "the role admin" in problem(answer, 403, "not-your-job")["detail"]
        assert mine.patch(path, json={"priority": 1}).status_code == 200
        cancelled = mine.post(f"{path}/cancel").json()
        assert cancelled["state"] == "cancelled"
        assert cancelled["reason"] == "cancelled by a submitter"
        problem(yours.post("/v1/jobs/0123456789ab/cancel"), 404, "unknown-job")
        # An admin steers them all
        assert as_("admin").post(f"/v1/jobs/{nobodys}/cancel").status_code == 202
        assert Jobs(client).get(nobodys).state is JobState.CANCELLED

    def test_counts_in_a_batch_for_each_job(self, as_: As, client: redis.Redis) -> None:
        mine, yours = as_("submitter"), as_("submitter")
        made = [submit(one, spec={"batch": "b"}).json()["id"] for one in (mine, yours)]
        assert mine.post("/v1/batches/b/cancel").status_code == 202
        states = [Jobs(client).get(job_id).state for job_id in made]
        assert states == [JobState.CANCELLED, JobState.QUEUED]


def test_a_key_has_so_many_jobs_at_once_and_so_much_room(as_: As) -> None:
    mine = as_("submitter", open_jobs=1, upload_bytes=1000)
    first = submit(mine).json()["id"]
    said = problem(submit(mine), 429, "too-many-jobs")
    assert (said["open_jobs"], said["limit"]) == (1, 1)
    mine.post(f"/v1/jobs/{first}/cancel")
    # Beside the scene a form may have 2 MiB: no limit of a key is missed by that
    found = problem(submit(mine, b"\0" * (2**21 + 2000)), 413, "upload-too-large")
    assert "the limit of the key 'a submitter'" in found["detail"]
    assert submit(mine).status_code == 201
    # Given a key that has stored as much as it may, another scene is refused
    own, more = BOX + b"<!-- own -->", BOX + b"<!-- another -->"
    mine, other = as_("submitter", scenes_bytes=len(own) + 10), as_("submitter")
    assert submit(mine, own).status_code == 201
    said = problem(submit(mine, more), 403, "too-many-scenes")
    assert (said["stored_bytes"], said["limit_bytes"]) == (len(own), len(own) + 10)
    # And what is stored it may submit as often as it likes, also what another key has sent
    for sender, scene in ((mine, own), (other, more), (mine, more)):
        assert submit(sender, scene).status_code == 201


def test_without_redis_it_answers_503_never_401(redis_url: str, api_store: Blobs) -> None:
    away = "unix:///nowhere/redis.sock"
    for access in (Access.UNTIL_KEYS, Access.KEYS):
        with live_http(away, api_store, access=access) as http:
            for headers in ({}, {"Authorization": f"Bearer plateau_{'0' * 12}_{'0' * 64}"}):
                for answer in (
                    http.get("/v1/jobs", headers=headers),
                    http.get("/v1/jobs/0123456789ab", headers=headers),
                    http.get("/readyz", headers=headers),
                    http.get("/metrics", headers=headers),
                    submit(http, headers=headers),
                ):
                    said = problem(answer, 503, "store-unavailable")
                    assert "Redis cannot be reached" in said["detail"]
                    assert int(answer.headers["retry-after"]) > 0
            assert http.get("/healthz").status_code == 200
