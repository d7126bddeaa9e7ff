"""What HTTP promises: methods, paths, parameters, headers and forms that are not there."""

import socket
from typing import Any
from urllib.parse import urlsplit

import httpx
import pytest
import redis

from plateau.client.watching import parse_events
from plateau.farm.blobs.store import Blobs
from plateau.farm.model import versions
from plateau.service.api.http.parameters import chosen
from plateau.service.api.problems.problem import Problem
from tests.service.api.routes.test_jobs import problem, submit
from tests.support.farms.staged_job import StagedJob
from tests.support.scenes.bundles import scene

JSON, CSV, SSE = "application/json", "text/csv", "text/event-stream"


class TestAMethod:
    @pytest.mark.parametrize(
        ("path", "allowed"),
        [
            ("/v1/jobs", "GET, HEAD, POST"),
            ("/v1/jobs/0123456789ab", "DELETE, GET, HEAD, PATCH"),
            ("/v1/jobs/0123456789ab/cancel", "POST"),
            ("/v1/jobs/0123456789ab/image.png", "GET, HEAD"),
            ("/healthz", "GET, HEAD"),
        ],
    )
    @pytest.mark.parametrize("method", ["PUT", "OPTIONS", "FANCY"])
    def test_that_a_path_does_not_have_is_answered_with_those_it_has(
        self, http: httpx.Client, path: str, allowed: str, method: str
    ) -> None:
        answer = http.request(method, path)
        problem(answer, 405, "method-not-allowed")
        assert answer.headers["allow"] == allowed

    def test_head_answers_wherever_get_does(
        self, http: httpx.Client, client: redis.Redis, api_store: Blobs
    ) -> None:
        job = StagedJob(client)
        job.commit()
        job.picture(api_store, "image.png", b"picture")
        root = f"/v1/jobs/{job.id}"
        # The stream of this job's events would not end
        for path in ("/v1/jobs", root, f"{root}/curve", f"{root}/image.png", f"{root}/events"):
            head = http.head(path)
            assert (head.status_code, head.content) == (200, b""), path
            if not path.endswith("/events"):
                got = http.get(path).headers
                for name in ("content-type", "content-length"):
                    assert head.headers[name] == got[name], path
        assert http.head(f"{root}/events").headers["content-type"].startswith(SSE)
        assert http.head("/v1/jobs/0123456789ab").status_code == 404
        assert http.head(f"{root}/cancel").status_code == 405


class TestAPath:
    @pytest.mark.parametrize("path", ["/v1", "/v1/jobs/x/y/z", "/v1//jobs", "/V1/jobs", "/%00"])
    def test_that_is_not_there_is_a_problem(self, http: httpx.Client, path: str) -> None:
        answer = http.get(path)
        assert answer.status_code == 404
        assert answer.json()["type"] == "/problems/unknown-path"

    def test_that_is_not_there_is_a_page_for_who_looks(self, http: httpx.Client) -> None:
        looks = {"Accept": "text/html,application/xhtml+xml,*/*;q=0.8"}
        answer = http.get("/job/box", headers=looks)
        assert (answer.status_code, answer.headers["content-type"]) == (
            404,
            "text/html; charset=utf-8",
        )
        assert answer.headers["content-security-policy"]
        problem(http.get("/v1/job/box", headers=looks), 404, "unknown-path")
        problem(http.post("/job/box", headers=looks), 404, "unknown-path")

    @pytest.mark.parametrize("index", ["x", "-1", "1.5", "9" * 5000])
    def test_with_an_index_that_is_none_is_refused(
        self, http: httpx.Client, client: redis.Redis, index: str
    ) -> None:
        answer = http.get(f"/v1/jobs/{StagedJob(client).id}/slices/{index}.exr")
        found = problem(answer, 422, "invalid-request")
        assert [one["field"] for one in found["errors"]] == ["index"]

    @pytest.mark.parametrize("path", ["/v1/jobs/", "/healthz/"])
    def test_has_no_slash_at_its_end_and_is_not_redirected(
        self, http: httpx.Client, path: str
    ) -> None:
        for answer in (http.get(path), http.post(path)):
            found = problem(answer, 404, "unknown-path")
            assert "without a slash at its end" in found["detail"]


class TestAQueryParameter:
    def test_that_the_route_does_not_have_is_refused_where_it_has_some(
        self, http: httpx.Client, client: redis.Redis
    ) -> None:
        found = problem(
            http.get("/v1/jobs", params={"stat": "queued", "limit": "1"}), 422, "invalid-request"
        )
        [error] = found["errors"]
        assert error["field"] == "stat"
        assert error["message"].endswith(
            "there are state, batch, owner, search, deleted, cursor, limit"
        )
        events = f"/v1/jobs/{StagedJob(client).id}/events"
        problem(http.get(events, params={"from": "0-0"}), 422, "invalid-request")

    def test_is_of_no_meaning_where_the_route_has_none(
        self, http: httpx.Client, client: redis.Redis
    ) -> None:
        path = f"/v1/jobs/{StagedJob(client).id}/curve"
        assert http.get(path, params={"new": "1"}).status_code == 200

    @pytest.mark.parametrize(
        ("name", "value"),
        [
            ("limit", "-1"),
            ("limit", "1e2"),
            ("limit", "9" * 5000),
            ("cursor", "٣"),  # a digit, but none of ASCII
            ("cursor", "9" * 16),
            ("state", ""),
        ],
    )
    def test_out_of_range_is_named(self, http: httpx.Client, name: str, value: str) -> None:
        found = problem(http.get("/v1/jobs", params={name: value}), 422, "invalid-request")
        assert [one["field"] for one in found["errors"]] == [name]

    @pytest.mark.parametrize(
        ("query", "field", "message"),
        [
            ("pool=", "pool", "must not be empty"),
            ("tag=night&tag=a%20b", "tag.1", "must begin with a letter or a digit"),
        ],
    )
    def test_of_several_types_is_named_as_the_caller_does(
        self, http: httpx.Client, query: str, field: str, message: str
    ) -> None:
        [error] = problem(http.get(f"/v1/demand?{query}"), 422, "invalid-request")["errors"]
        assert error["field"] == field
        assert error["message"].startswith(message)

    @pytest.mark.parametrize("after", ["٣-٣", f"{2**64}-0", f"0-{2**64}", "0-0\n"])
    def test_that_redis_would_refuse_is_refused_before(
        self, http: httpx.Client, client: redis.Redis, after: str
    ) -> None:
        path = f"/v1/jobs/{StagedJob(client).id}/events"
        answer = http.get(path, params={"after": after}, headers={"Accept": JSON})
        problem(answer, 422, "invalid-request")

    def test_of_the_largest_event_id_is_taken(
        self, http: httpx.Client, client: redis.Redis
    ) -> None:
        path = f"/v1/jobs/{StagedJob(client).id}/events"
        largest = f"{'9' * 19}-{'9' * 19}"
        answer = http.get(path, params={"after": largest}, headers={"Accept": JSON})
        assert answer.json() == {"events": []}


class TestAccept:
    @pytest.mark.parametrize(
        ("accept", "expected"),
        [
            ("", JSON),
            ("*/*", JSON),
            ("text/csv", CSV),
            ("TEXT/CSV; charset=utf-8", CSV),
            ("text/*", CSV),
            ("text/csv;q=0.5, application/json;q=0.4", CSV),
            ("text/csv;q=0, */*", JSON),
            ("application/json;q=0, */*;q=0.1", CSV),
            ("text/html,application/xhtml+xml,*/*;q=0.8", JSON),
            ("text/csv, application/json", JSON),
            (" ,, text/csv", CSV),
        ],
    )
    def test_chooses_by_quality_then_by_our_order(self, accept: str, expected: str) -> None:
        assert chosen(accept, (JSON, CSV)) == expected

    @pytest.mark.parametrize("accept", ["image/png", "text/csv;q=0, application/json;q=0.000"])
    def test_of_nothing_on_offer_is_a_problem(self, accept: str) -> None:
        with pytest.raises(Problem, match="comes as application/json or text/csv"):
            chosen(accept, (JSON, CSV))

    def test_that_cannot_be_met_is_406_where_there_is_a_choice(
        self, http: httpx.Client, client: redis.Redis
    ) -> None:
        root = f"/v1/jobs/{StagedJob(client).id}"
        for path, offers in (("curve", [JSON, CSV]), ("events", [SSE, JSON])):
            answer = http.get(f"{root}/{path}", headers={"Accept": "image/png"})
            assert problem(answer, 406, "not-acceptable")["offers"] == offers
        # Elsewhere there is one form, and who asks gets it
        assert http.get(root, headers={"Accept": "image/png"}).status_code == 200

    def test_of_both_forms_of_events_gives_the_stream(
        self, http: httpx.Client, client: redis.Redis
    ) -> None:
        job = StagedJob(client, keep_slices=True)
        job.commit()
        job.end()
        job.finish()
        both = {"Accept": f"{JSON}, {SSE}"}
        answer = http.get(f"/v1/jobs/{job.id}/events", headers=both)
        assert [event.type for event in parse_events(answer.text.splitlines())][-1] == "finished"


class TestABody:
    def test_that_is_missing_is_said_to_be(self, http: httpx.Client) -> None:
        problem(http.post("/v1/jobs"), 422, "no-scene")

    def test_without_a_boundary_cannot_be_read(self, http: httpx.Client) -> None:
        headers = {"Content-Type": "multipart/form-data"}
        problem(http.post("/v1/jobs", content=b"x", headers=headers), 400, "malformed-request")

    @pytest.mark.parametrize("body", [b"\xff]", b'{"priority": 1', b"[" * 60_000])
    def test_that_is_no_json_is_a_problem(
        self, http: httpx.Client, client: redis.Redis, body: bytes
    ) -> None:
        headers = {"Content-Type": JSON}
        answer = http.patch(f"/v1/jobs/{StagedJob(client).id}", content=body, headers=headers)
        assert answer.status_code in {400, 422}
        assert answer.headers["content-type"] == "application/problem+json"

    @pytest.mark.parametrize("priority", [False, "5", 1.5, None, 1001])
    def test_of_another_type_is_not_taken_for_a_number(
        self, http: httpx.Client, client: redis.Redis, priority: Any
    ) -> None:
        answer = http.patch(f"/v1/jobs/{StagedJob(client).id}", json={"priority": priority})
        found = problem(answer, 422, "invalid-request")
        assert [one["field"] for one in found["errors"]] == ["priority"]

    @pytest.mark.parametrize(
        ("spec", "field"),
        [
            ({"max_spp": "2000"}, "spec.max_spp"),
            ({"seed": True}, "spec.seed"),
            ({"keep_slices": 1}, "spec.keep_slices"),
            ({"view": {"exposure_ev": "1"}}, "spec.view.exposure_ev"),
        ],
    )
    def test_with_a_spec_of_other_types_is_refused(
        self, http: httpx.Client, spec: dict[str, Any], field: str
    ) -> None:
        found = problem(submit(http, spec=spec), 422, "invalid-spec")
        assert [one["field"] for one in found["errors"]] == [field]


class TestAWholeNumber:
    """JSON has one kind of number, and its schema takes 10.0 for an integer."""

    def test_may_be_written_with_a_point(self, http: httpx.Client) -> None:
        asked = {
            "max_spp": 200.0,
            "step": 1e2,
            "min_spp": 10.0,
            "zones": [2.0, 3],
            "rule": {"name": "fixed", "spp": 100.0},
            "watch": [{"name": "reverse", "window": 6.0}],
            "view": {"exposure_ev": 1.0},
        }
        answer = submit(http, spec=asked)
        assert answer.status_code == 201, answer.text
        spec = answer.json()["spec"]
        assert {name: spec[name] for name in ("max_spp", "step", "min_spp", "zones")} == {
            "max_spp": 200,
            "step": 100,
            "min_spp": 10,
            "zones": [2, 3],
        }
        assert spec["rule"]["spp"] == 100
        assert spec["watch"][0]["window"] == 6

    def test_is_left_to_a_scene_as_it_was_written(self, http: httpx.Client) -> None:
        sphere = '<shape type="sphere"><float name="radius" value="$radius"/></shape>'
        given = scene('<default name="radius" value="1"/>', sphere)
        assert '"radius":2.0' in submit(http, given, {"parameters": {"radius": 2.0}}).text
        batch = submit(http, given, {"parameters": [{"radius": 3.0}, {"radius": 4}]}).json()
        assert '"radius":3.0' in http.get(f"/v1/jobs/{batch['job_ids'][0]}").text

    def test_may_be_so_in_any_body(self, http: httpx.Client, client: redis.Redis) -> None:
        job = StagedJob(client, keep_slices=True)
        answer = http.patch(f"/v1/jobs/{job.id}", json={"priority": 7.0})
        assert answer.json()["spec"]["priority"] == 7
        job.commit()
        job.end()
        job.finish()
        # It is another field that is refused, by its name
        answer = http.post(f"/v1/jobs/{job.id}/again", json={"max_spp": 400.0, "min_spp": 10.5})
        found = problem(answer, 422, "invalid-spec")
        assert [one["field"] for one in found["errors"]] == ["spec.min_spp"]

    def test_in_quotes_is_none(self, http: httpx.Client, client: redis.Redis) -> None:
        job = StagedJob(client, keep_slices=True)
        job.commit()
        job.end()
        job.finish()
        answer = http.post(f"/v1/jobs/{job.id}/again", json={"max_spp": "400"})
        found = problem(answer, 422, "invalid-spec")
        assert [one["field"] for one in found["errors"]] == ["spec.max_spp"]


class TestHeaders:
    def test_of_more_than_64_kib_end_the_connection_and_no_more(self, http: httpx.Client) -> None:
        url = urlsplit(str(http.base_url))
        with socket.create_connection((url.hostname, url.port), timeout=10) as connection:
            connection.sendall(b"GET /v1/jobs HTTP/1.1\r\nHost: localhost\r\nX: " + b"x" * 70_000)
            assert connection.recv(100).startswith(b"HTTP/1.1 400 ")
        assert http.get("/healthz").status_code == 200

    def test_of_a_fair_size_do_no_harm(self, http: httpx.Client) -> None:
        assert http.get("/healthz", headers={"X": "x" * 30_000}).status_code == 200

    def test_that_would_let_other_sites_in_are_never_sent(self, http: httpx.Client) -> None:
        own = str(http.base_url).rstrip("/")
        answers = [
            http.get("/v1/jobs", headers={"Origin": own}),
            http.options(
                "/v1/jobs",
                headers={"Origin": "http://evil.example", "Access-Control-Request-Method": "POST"},
            ),
        ]
        problem(answers[1], 403, "foreign-origin")
        for answer in answers:
            assert not [name for name in answer.headers if name.startswith("access-control")]

    def test_say_which_plateau_answers(self, http: httpx.Client) -> None:
        for path in ("/v1/jobs", "/v1/jobs/0123456789ab"):
            assert http.get(path).headers["plateau-version"] == versions.plateau()
        # To those who are let in alone
        assert "plateau-version" not in http.get("/v1/jobs", headers={"Origin": "http://x"}).headers
