"""What a browser may do with an answer, who may ask, and where a request ends."""

import re
import socket
from urllib.parse import urlsplit

import httpx
import pytest
import redis

from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.api_keys import ApiKeys, KeyLimits, Role
from plateau.farm.redis import keys
from plateau.farm.redis.url import is_loopback
from tests.support.api_calls import problem, submit
from tests.support.farms.staged_job import StagedJob


def exchange(http: httpx.Client, sent: bytes) -> bytes:
    """What is answered to these bytes until the connection is closed."""
    url = urlsplit(str(http.base_url))
    with socket.create_connection((url.hostname, url.port), timeout=30) as connection:
        connection.sendall(sent)
        return b"".join(iter(lambda: connection.recv(65_536), b""))


def parsed(answered: bytes) -> httpx.Response:
    """The first of the answers."""
    head, _, body = answered.partition(b"\r\n\r\n")
    status, *lines = head.decode().split("\r\n")
    headers = [tuple(line.split(": ", 1)) for line in lines]
    return httpx.Response(int(status.split()[1]), headers=headers, content=body)


def malformed(answered: bytes) -> httpx.Response:
    """The one answer to these bytes: a problem."""
    answer = parsed(answered)
    assert answer.status_code == 400
    assert answer.headers["content-type"] == "application/problem+json"
    assert answer.json()["type"] == "/problems/malformed-request"
    assert len(re.findall(rb"HTTP/1\.1 \d", answered)) == 1
    return answer


def assert_safe(answer: httpx.Response) -> None:
    """Both headers once each: a list of two is no policy to a browser."""
    name = f"{answer.status_code} {answer.headers}"
    assert answer.headers.get_list("x-content-type-options") == ["nosniff"], name
    assert answer.headers.get_list("cross-origin-resource-policy") == ["same-origin"], name


class TestEveryAnswer:
    """No browser takes it for what it is not, nor gives it to a page of another site."""

    @pytest.mark.parametrize(
        ("method", "path", "status"),
        [
            ("GET", "/", 200),
            ("GET", "/page/main.js", 200),
            ("GET", "/docs", 200),
            ("GET", "/openapi.json", 200),
            ("GET", "/healthz", 200),
            ("HEAD", "/healthz", 200),
            ("GET", "/metrics", 200),
            ("GET", "/v1/jobs", 200),
            ("GET", "/v1/nothing", 404),
            ("DELETE", "/v1/jobs", 405),
            ("POST", "/v1/jobs", 422),
            ("GET", "/v1/jobs?limit=0", 422),
        ],
    )
    def test_of_the_app_says_so(
        self, http: httpx.Client, method: str, path: str, status: int
    ) -> None:
        answer = http.request(method, path)
        assert answer.status_code == status
        assert_safe(answer)

    def test_of_a_job_and_to_a_caller_who_is_refused_says_so(
        self, http: httpx.Client, client: redis.Redis, api_store: Blobs
    ) -> None:
        job = StagedJob(client)
        job.commit()
        job.picture(api_store, "image.png", b"picture")
        job.end()
        job.finish()
        root = f"/v1/jobs/{job.id}"
        for path in ("image.png", "curve.csv", "events"):
            answer = http.get(f"{root}/{path}")
            assert answer.status_code == 200, path
            assert_safe(answer)
        for path in ("/page/shared/style.css", f"{root}/curve"):
            known = {"If-None-Match": http.get(path).headers["etag"]}
            unchanged = http.get(path, headers=known)
            assert unchanged.status_code == 304
            assert_safe(unchanged)
        client.xadd(keys.job(job.id, "curve"), {"point": "no JSON"})
        answer = http.get(f"{root}/curve", headers={"Connection": "close"})
        problem(answer, 500, "internal-error")
        assert_safe(answer)
        assert_safe(http.get("/v1/jobs", headers={"Host": "evil.example"}))
        key = ApiKeys(client).create("a viewer", Role.VIEWER, KeyLimits())[1]
        answer = http.get("/v1/jobs", headers={"Authorization": f"Bearer {key}"})
        assert answer.status_code == 200
        assert_safe(answer)
        assert_safe(http.get("/v1/jobs"))  # 401

    @pytest.mark.parametrize(
        "sent",
        [
            b"nonsense\r\n\r\n",
            b"GET /v1/jobs HTTP/1.1\r\n\r\n",  # no Host
            b"GET /v1/jobs HTTP/1.1\r\nHost: localhost\r\nHost: evil.example\r\n\r\n",
            b"GET /v1/jobs HTTP/1.1\r\nHost: localhost\r\nX: ".ljust(2**16 + 1, b"x"),
            b"POST /v1 HTTP/1.0\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n",
            b"POST /v1/jobs HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\nx\r\n",
        ],
        ids=["no HTTP", "no Host", "two hosts", "a head just too long", "old chunks", "no length"],
    )
    def test_of_the_server_itself_is_a_problem_and_says_so(
        self, http: httpx.Client, sent: bytes
    ) -> None:
        assert_safe(malformed(exchange(http, sent)))
        assert http.get("/healthz").status_code == 200


class TestALength:
    """Where a request ends is said once, so that a proxy in front cannot think otherwise."""

    HIDDEN = b"GET /v1/jobs/hidden HTTP/1.1\r\nHost: localhost\r\n\r\n"

    @pytest.mark.parametrize("length", [b"4", b"5", b"0"])
    def test_that_is_said_twice_is_refused_and_nothing_behind_it_is_heard(
        self, http: httpx.Client, length: bytes
    ) -> None:
        for path in (b"/v1/jobs", b"/", b"/healthz"):
            answered = exchange(
                http,
                b"POST " + path + b" HTTP/1.1\r\nHost: localhost\r\nContent-Length: " + length
                + b"\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n" + self.HIDDEN,
            )  # fmt: skip
            assert_safe(malformed(answered))

    @pytest.mark.parametrize(
        "framing",
        [
            b"Content-Length: 5\r\nContent-Length: 6",
            b"Content-Length: 5, 6",
            b"Content-Length: +5",
            b"Content-Length: 0x5",
            b"Transfer-Encoding: chunked\r\nTransfer-Encoding: identity",
            b"Transfer-Encoding: xchunked",
            b"Transfer-Encoding : chunked",
        ],
    )
    def test_that_is_not_plain_is_refused(self, http: httpx.Client, framing: bytes) -> None:
        answered = exchange(
            http,
            b"POST /v1/jobs HTTP/1.1\r\nHost: localhost\r\n" + framing + b"\r\n\r\n" + self.HIDDEN,
        )
        malformed(answered)

    def test_in_chunks_alone_is_taken(self, http: httpx.Client, client: redis.Redis) -> None:
        path = f"/v1/jobs/{StagedJob(client).id}"
        body = iter([b'{"prio', b'rity": 3}'])
        answer = http.patch(path, content=body, headers={"Content-Type": "application/json"})
        assert answer.json()["spec"]["priority"] == 3


class TestPagesOfOthers:
    """What a browser does for a page of another site, to an API that wants no keys."""

    @pytest.mark.parametrize("site", ["cross-site", "same-site", "Cross-Site", "new-site"])
    def test_neither_read_nor_change_anything(self, http: httpx.Client, site: str) -> None:
        headers = {"Sec-Fetch-Site": site, "Sec-Fetch-Mode": "no-cors"}
        for answer in (
            http.get("/v1/jobs", headers=headers),
            http.get("/metrics", headers=headers),
            http.head("/v1/jobs", headers=headers),
            submit(http, headers=headers),
        ):
            assert answer.status_code == 403
        said = problem(http.get("/v1/jobs", headers=headers), 403, "foreign-origin")
        assert "enter its address yourself" in said["detail"]
        assert http.get("/v1/jobs").json()["jobs"] == []

    def test_are_told_from_the_user_s_own_requests(self, http: httpx.Client) -> None:
        for site in ("none", "same-origin"):
            assert http.get("/v1/jobs", headers={"Sec-Fetch-Site": site}).status_code == 200
            assert submit(http, headers={"Sec-Fetch-Site": site}).status_code == 201

    def test_may_link_to_the_web_page(self, http: httpx.Client) -> None:
        how = {"Site": "cross-site", "Mode": "navigate", "Dest": "document"}
        headers = {f"Sec-Fetch-{name}": value for name, value in how.items()}
        for path in ("/", "/jobs/0123456789ab", "/submit", "/docs"):
            assert http.get(path, headers=headers).status_code == 200

    def test_have_no_key_so_one_who_brings_it_is_let_in(
        self, http: httpx.Client, client: redis.Redis
    ) -> None:
        key = ApiKeys(client).create("a viewer", Role.VIEWER, KeyLimits())[1]
        headers = {"Sec-Fetch-Site": "cross-site", "Authorization": f"Bearer {key}"}
        assert http.get("/v1/jobs", headers=headers).status_code == 200


class TestAHost:
    """A name is this machine's as a whole, or not at all."""

    def test_that_only_begins_or_ends_so_is_another(self, http: httpx.Client) -> None:
        for host in (
            *("evil.example", "evil.example:80", "localhost.evil.example", "evil-localhost"),
            *("evil.localhost", "localhost.", "evil.example@localhost", "localhost:"),
            *("localhost:80@evil.example", "localhost/evil.example", "localhost?evil.example"),
            *("localhost#evil.example", "localhost:evil.example", "127.0.0.1.evil.example"),
            *("127.0.0.1:80.evil.example", "[::1].evil.example", "[::1%25evil.example]"),
            *("[127.0.0.1]", "[localhost]", "localhost, evil.example", "0.0.0.0"),
        ):
            problem(http.get("/v1/jobs", headers={"Host": host}), 403, "foreign-host")

    def test_may_have_any_port_and_case(self, http: httpx.Client) -> None:
        for host in ("localhost", "LocalHost:9000", "127.0.0.1:1", "[::1]:8713"):
            assert http.get("/v1/jobs", headers={"Host": host}).status_code == 200

    def test_to_listen_on_is_looked_at_as_a_whole_too(self) -> None:
        assert all(map(is_loopback, ("localhost", "127.0.0.1", "127.9.9.9", "::1", "[::1]")))
        strange = ("[[::1]]", "[127.0.0.1]", "[::1", "::1]", "localhost.")
        others = ("0.0.0.0", "::", "192.168.0.1", "example.org", "")
        assert not any(map(is_loopback, (*strange, *others)))
