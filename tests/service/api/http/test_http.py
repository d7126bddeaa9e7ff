"""What HTTP promises: methods, paths, parameters, headers and forms that are not there."""

import httpx
import pytest
import redis

from plateau.farm.blobs.store import Blobs
from plateau.farm.model import versions
from tests.support.api_calls import problem, submit
from tests.support.farms.staged_job import StagedJob
from tests.support.scenes.bundles import scene

JSON = "application/json"


class TestAMethod:
    @pytest.mark.parametrize("method", ["PUT", "OPTIONS", "FANCY"])
    def test_that_a_path_does_not_have_is_answered_with_those_it_has(
        self, http: httpx.Client, method: str
    ) -> None:
        for path, allowed in (
            ("/v1/jobs", "GET, HEAD, POST"),
            ("/v1/jobs/0123456789ab", "DELETE, GET, HEAD, PATCH"),
            ("/v1/jobs/0123456789ab/cancel", "POST"),
            ("/healthz", "GET, HEAD"),
        ):
            answer = http.request(method, path)
            problem(answer, 405, "method-not-allowed")
            assert answer.headers["allow"] == allowed

    def test_head_answers_wherever_get_does(
        self, http: httpx.Client, client: redis.Redis, api_store: Blobs
    ) -> None:
        job = StagedJob(client)
        job.commit()
        job.picture(api_store, "image.png", b"picture")
        job.end()  # one that runs says how long it has run
        root = f"/v1/jobs/{job.id}"
        # The stream of this job's events would not end
        for path in ("/v1/jobs", root, f"{root}/curve", f"{root}/image.png"):
            head, got = http.head(path), http.get(path).headers
            assert (head.status_code, head.content) == (200, b""), path
            for name in ("content-type", "content-length"):
                assert head.headers[name] == got[name], path
        assert http.head(f"{root}/events").headers["content-type"].startswith("text/event-stream")
        assert http.head("/v1/jobs/0123456789ab").status_code == 404
        assert http.head(f"{root}/cancel").status_code == 405


def test_a_path_that_is_not_there_is_a_problem_and_a_page_for_who_looks(http: httpx.Client) -> None:
    for path in ("/v1", "/v1/jobs/x/y/z", "/v1//jobs", "/V1/jobs", "/%00"):
        answer = http.get(path)
        assert answer.status_code == 404
        assert answer.json()["type"] == "/problems/unknown-path"
    for path in ("/v1/jobs/", "/healthz/"):
        for answer in (http.get(path), http.post(path)):
            found = problem(answer, 404, "unknown-path")
            assert "without a slash at its end" in found["detail"]
    looks = {"Accept": "text/html,application/xhtml+xml,*/*;q=0.8"}
    answer = http.get("/job/box", headers=looks)
    assert (answer.status_code, answer.headers["content-type"]) == (404, "text/html; charset=utf-8")
    assert answer.headers["content-security-policy"]
    problem(http.get("/v1/job/box", headers=looks), 404, "unknown-path")
    problem(http.post("/job/box", headers=looks), 404, "unknown-path")


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

    def test_of_several_types_is_named_as_the_caller_does(self, http: httpx.Client) -> None:
        for query, field, message in (
            ("pool=", "pool", "must not be empty"),
            ("tag=night&tag=a%20b", "tag.1", "must begin with a letter or a digit"),
        ):
            [error] = problem(http.get(f"/v1/demand?{query}"), 422, "invalid-request")["errors"]
            assert error["field"] == field
            assert error["message"].startswith(message)

    def test_that_redis_would_refuse_is_refused_before(
        self, http: httpx.Client, client: redis.Redis
    ) -> None:
        path = f"/v1/jobs/{StagedJob(client).id}/events"
        for after in ("٣-٣", f"{2**64}-0", f"0-{2**64}", "0-0\n", "x", "1", "1-2-3", "-"):
            answer = http.get(path, params={"after": after}, headers={"Accept": JSON})
            problem(answer, 422, "invalid-request")
        problem(http.get(path, headers={"Last-Event-ID": "x"}), 422, "invalid-request")
        largest = f"{'9' * 19}-{'9' * 19}"
        answer = http.get(path, params={"after": largest}, headers={"Accept": JSON})
        assert answer.json() == {"events": []}


class TestAWholeNumber:
    """JSON has one kind of number, and its schema takes 10.0 for an integer."""

    def test_may_be_written_with_a_point(self, http: httpx.Client) -> None:
        rule = {"name": "fixed", "spp": 100.0}
        asked = {"max_spp": 200.0, "step": 1e2, "priority": 7.0, "rule": rule}
        answer = submit(http, spec=asked)
        assert answer.status_code == 201, answer.text
        spec = answer.json()["spec"]
        assert {name: spec[name] for name in asked} == asked
        assert '"max_spp":200,' in answer.text

    def test_is_left_to_a_scene_as_it_was_written(self, http: httpx.Client) -> None:
        sphere = '<shape type="sphere"><float name="radius" value="$radius"/></shape>'
        given = scene('<default name="radius" value="1"/>', sphere)
        assert '"radius":2.0' in submit(http, given, {"parameters": {"radius": 2.0}}).text
        batch = submit(http, given, {"parameters": [{"radius": 3.0}, {"radius": 4}]}).json()
        assert '"radius":3.0' in http.get(f"/v1/jobs/{batch['job_ids'][0]}").text


class TestHeaders:
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


EDGE = "multipart/form-data; boundary=edge"
NAMED = 'Content-Disposition: form-data; name="{}"'


def form(*parts: str) -> bytes:
    """The body of a form whose parts have these heads."""
    return "".join(f"--edge\r\n{part}\r\n\r\nx\r\n" for part in parts).encode() + b"--edge--\r\n"


def file(name: str) -> str:
    return f'{NAMED.format(name)}; filename="a.xml"'


BROKEN_FORMS = {
    "no boundary": ("multipart/form-data", b"x", "Missing boundary"),
    "a long boundary": (f"multipart/form-data; boundary={'x' * 300}", b"x", "cannot be read"),
    "no parts": (EDGE, b"x", "cannot be read"),
    "a part without a name": (EDGE, form("Content-Disposition: form-data"), "must be provided"),
    "three files": (EDGE, form(*map(file, "abc")), "Too many files"),
    "nine fields": (EDGE, form(*map(NAMED.format, "abcdefghi")), "Too many fields"),
    "a scene that is no file": (
        EDGE,
        form(NAMED.format("scene")).replace(b"x\r\n", b"x" * (1 << 20) + b"x\r\n"),
        "send a scene as a file",
    ),
}


@pytest.mark.parametrize(
    ("media_type", "body", "words"), BROKEN_FORMS.values(), ids=BROKEN_FORMS.keys()
)
def test_a_form_that_cannot_be_read_says_what_to_send(
    http: httpx.Client, media_type: str, body: bytes, words: str
) -> None:
    answer = http.post("/v1/jobs", content=body, headers={"Content-Type": media_type})
    assert words in problem(answer, 400, "malformed-request")["detail"]


@pytest.mark.parametrize("body", [b'{"job_id": 1', b'"\xff"', b"[" * 60_000])
def test_a_body_that_is_not_json_says_what_to_send(http: httpx.Client, body: bytes) -> None:
    answer = http.post("/v1/studies", content=body, headers={"Content-Type": "application/json"})
    found = problem(answer, 400, "malformed-request")
    assert found["detail"].startswith("the body is not JSON")
