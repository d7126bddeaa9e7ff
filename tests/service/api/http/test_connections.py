"""Connections that do nothing are closed, and more than there may be are refused in words."""

import contextlib
import http.client
import logging
import resource
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import httpx
import psutil
import pytest

from plateau.farm.blobs.store import Blobs
from plateau.service.api import process
from plateau.service.api.http import server
from tests.support.api_calls import BOX, submit
from tests.support.farms.live_api import live_api
from tests.support.farms.real_farm import RealFarm
from tests.support.until import until

#: Where one is not closed, a test waits so long for it.
MOST_S = 60.0
HEAD = b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n"


@pytest.fixture
def url(redis_url: str, api_store: Blobs, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """An API that waits for a head for one second."""
    monkeypatch.setattr(server, "HEAD_S", 1.0)
    with live_api(redis_url, api_store) as url:
        yield url


def connected(url: str) -> socket.socket:
    address = urlsplit(url)
    return socket.create_connection((address.hostname or "", address.port or 0), timeout=MOST_S)


def rest(connection: socket.socket) -> bytes:
    """All that still comes until the other side closes."""
    return b"".join(iter(lambda: connection.recv(4096), b""))


def answered(connection: socket.socket) -> bytes:
    """An answer with a short body, of a connection that stays open."""
    connection.sendall(HEAD + b"\r\n")
    answer = http.client.HTTPResponse(connection)
    answer.begin()
    return answer.read()


def trickle(connection: socket.socket) -> None:
    """Send a head without end, a byte at a time, until the other side has closed."""
    is_closed = threading.Event()

    def listen() -> None:
        with contextlib.suppress(ConnectionResetError):
            rest(connection)
        is_closed.set()

    listening = threading.Thread(target=listen)
    listening.start()
    with contextlib.suppress(BrokenPipeError, ConnectionResetError):
        while not is_closed.wait(0.05):
            connection.sendall(b"x")
    listening.join(MOST_S)
    assert is_closed.is_set()


LAST = b"\r\n--edge--\r\n"


def body_of(connection: socket.socket, length: int) -> None:
    """Begin an upload of a file of this length."""
    part = b'--edge\r\nContent-Disposition: form-data; name="scene"; filename="a.xml"\r\n\r\n'
    head = (
        "POST /v1/jobs HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n"
        f"Content-Length: {len(part) + length + len(LAST)}\r\n"
        "Content-Type: multipart/form-data; boundary=edge\r\n\r\n"
    )
    connection.sendall(head.encode() + part)


class TestAHead:
    @pytest.mark.parametrize("how", ["silent", "half a head", "bytes of a head"])
    @pytest.mark.parametrize("which", ["first", "second"])
    def test_that_does_not_come_ends_the_connection(
        self, url: str, which: str, how: str, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        with connected(url) as connection:
            if which == "second":
                monkeypatch.setattr(server, "HEAD_S", MOST_S)
                assert answered(connection)
                monkeypatch.setattr(server, "HEAD_S", 1.0)
                assert answered(connection)
            if how != "silent":
                connection.sendall(HEAD)
            if how == "bytes of a head":
                trickle(connection)
            else:
                assert rest(connection) == b""

    def test_has_no_say_in_uploads_and_streams(
        self, url: str, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(server, "HEAD_S", MOST_S)
        with httpx.Client(base_url=url, trust_env=False, verify=False, timeout=MOST_S) as http:
            job = submit(http, BOX).json()["id"]
            # Given a stream of events, and an upload of which half has come
            with (
                http.stream("GET", f"/v1/jobs/{job}/events") as events,
                connected(url) as uploading,
            ):
                parts = events.iter_lines()
                assert next(parts)
                body_of(uploading, len(BOX))
                uploading.sendall(BOX[:100])
                monkeypatch.setattr(server, "HEAD_S", 1.0)
                # When connections that ask for nothing have come and gone since
                for _ in range(2):
                    with connected(url) as idle:
                        assert rest(idle) == b""
                # Then the upload can go on
                uploading.sendall(BOX[100:] + LAST)
                assert b" 201 Created" in rest(uploading).partition(b"\r\n")[0]
                # And the stream tells what happens
                monkeypatch.setattr(server, "HEAD_S", MOST_S)
                http.post(f"/v1/jobs/{job}/cancel")
                assert any("cancelled" in line for line in parts)


def test_a_body_that_stops_ends_the_connection(
    url: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(server, "HEAD_S", MOST_S)
    monkeypatch.setattr(server, "BODY_S", 1.0)
    with connected(url) as connection:
        body_of(connection, 10**6)
        assert rest(connection) == b""
    # And it is counted as a request of a client that has gone, and is no error
    given_up = '_count{method="POST",route="/v1/jobs",status="4xx"} 1.0'
    with httpx.Client(base_url=url, verify=False, trust_env=False, timeout=60) as http:
        until(lambda: given_up in http.get("/metrics").text)
    assert [one.message for one in caplog.records if one.levelno >= logging.ERROR] == []


def test_an_answer_that_nobody_reads_ends_the_connection(
    redis_url: str, api_store: Blobs, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(process, "UNREAD_S", 0.5)
    with live_api(redis_url, api_store) as url, socket.socket() as connection:
        # Given a client with room for little, which asks for more than the kernel keeps
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        address = urlsplit(url)
        connection.connect((address.hostname or "", address.port or 0))
        connection.sendall(b"GET /openapi.json HTTP/1.1\r\nHost: localhost\r\n\r\n" * 50)
        ours = connection.getsockname()

        def is_served() -> bool:
            found = psutil.Process().net_connections("tcp")
            return any(one.raddr == ours and one.status != "CLOSE_WAIT" for one in found)

        # When it reads nothing, then the API has no such connection any more
        assert connection.recv(1)
        until(lambda: not is_served())


@pytest.fixture
def farm(tmp_path: Path) -> Iterator[RealFarm]:
    with RealFarm(tmp_path, tmp_path / "cache") as farm:
        yield farm


@pytest.mark.long
def test_there_are_fewer_connections_than_descriptors(farm: RealFarm, tmp_path: Path) -> None:
    # Given an API that may have 400 descriptors, and has 200 when it starts
    log = tmp_path / "api.log"
    with log.open("wb") as said:
        api = subprocess.Popen(
            [sys.executable, "-m", "plateau", "api", "--port", "0"],
            env=farm.environment,
            stderr=said,
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (200, 400)),
        )
    farm.processes.append(api)
    until(lambda: "listens at" in log.read_text())
    url = log.read_text().partition("listens at ")[2].split()[0]
    # Then it has given itself all that it may have
    assert psutil.Process(api.pid).rlimit(psutil.RLIMIT_NOFILE) == (400, 400)
    # When somebody opens more connections than that, and asks for nothing
    idle = [connected(url) for _ in range(500)]
    try:
        # Then those beyond a hundred are refused at once, in words
        head, _, body = rest(idle[-1]).partition(b"\r\n\r\n")
        assert head.startswith(b"HTTP/1.1 503 ")
        assert b"application/problem+json" in head
        assert b"try again in 2 s" in body
        # And one that was there before is served
        assert answered(idle[0])
        assert psutil.Process(api.pid).num_fds() < 300
    finally:
        for connection in idle:
            connection.close()
    # And, once they are gone, so is who comes then
    with httpx.Client(base_url=url, verify=False, trust_env=False, timeout=60) as http:
        until(lambda: http.get("/readyz").status_code == 200)
    # And the log has no more to say of it than of anything else
    assert "out of system resource" not in log.read_text()
    assert len(log.read_text()) < 5000


def test_a_limit_leaves_room_for_all_else() -> None:
    for descriptors in (1, 64, 256, 1024, 20_000, 2**20):
        most = server.most_connections(descriptors)
        waiting = server.backlog(descriptors)
        assert 1 <= most <= 10_000
        # All have a second descriptor, and those that are accepted at once to be refused fit too
        assert 2 * most <= descriptors or descriptors == 1
        assert most + waiting <= descriptors or descriptors == 1
