"""The client against wrong addresses, what is no service, and one that wants to be left alone."""

import contextlib
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest
from typer.testing import CliRunner

from plateau import ApiError, Client, Unreachable
from plateau.client import BadUrl, NotPlateau
from plateau.commands import app
from plateau.commands.connect import connect
from plateau.errors import ExitCode, OtherVersion
from plateau.farm.model import versions
from plateau.farm.wire.views import JobPage

#: Status, body and headers of an answer, by the number of requests before.
Answers = Callable[[int], tuple[int, bytes, dict[str, str]]]
_NO_JOBS = JobPage(jobs=[], next_cursor=None).model_dump_json().encode()


@pytest.fixture
def server() -> Iterator[Callable[[Answers], str]]:
    """Start a server that is none of ours; returns its URL."""
    running: list[ThreadingHTTPServer] = []

    def start(answers: Answers) -> str:
        asked = iter(range(1000))

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                status, body, headers = answers(next(asked))
                self.send_response(status)
                for name, value in {**headers, "Content-Length": str(len(body))}.items():
                    self.send_header(name, value)
                self.end_headers()
                with contextlib.suppress(BrokenPipeError):  # who asked may have left
                    self.wfile.write(body)

            def log_message(self, *_: object) -> None:
                pass

        running.append(ThreadingHTTPServer(("127.0.0.1", 0), Handler))
        threading.Thread(target=running[-1].serve_forever, daemon=True).start()
        return f"http://127.0.0.1:{running[-1].server_address[1]}"

    yield start
    for one in running:
        one.shutdown()
        one.server_close()


@pytest.mark.parametrize(
    "url", ["", "localhost:8713", "127.0.0.1", "ftp://farm", "http://", "http://a b"]
)
def test_a_url_that_cannot_be_one_is_refused_at_once(url: str) -> None:
    with pytest.raises(BadUrl, match=r"write it as http://127\.0\.0\.1:8713"):
        Client(url)


@pytest.mark.parametrize(
    ("status", "body"),
    [
        (404, b"<html>nothing here</html>"),
        (200, b"<html>hello</html>"),
        (200, b'{"a": 1}'),
        (301, b""),
    ],
)
def test_what_is_no_service_is_said_to_be_none(
    server: Callable[[Answers], str], status: int, body: bytes
) -> None:
    url = server(lambda _: (status, body, {"Location": "/elsewhere"}))
    with Client(url) as client, pytest.raises(NotPlateau, match=f"{url} is no Plateau service"):
        list(client.all_jobs())
    if status != 200:
        with Client(url) as client, pytest.raises(NotPlateau):
            next(client.events("0" * 12))


def test_a_service_that_wants_to_be_left_alone_for_a_second_is(
    server: Callable[[Answers], str],
) -> None:
    def answers(before: int) -> tuple[int, bytes, dict[str, str]]:
        if before == 0:
            problem = b'{"type": "/problems/too-many-requests", "detail": "slower"}'
            return 429, problem, {"Retry-After": "1"}
        return 200, _NO_JOBS, {}

    started = time.monotonic()
    with Client(server(answers)) as client:
        assert list(client.all_jobs()) == []
    assert time.monotonic() - started >= 1


def test_one_that_wants_to_be_left_alone_for_longer_than_the_client_is_patient_is_an_error(
    server: Callable[[Answers], str],
) -> None:
    problem = b'{"type": "/problems/too-many-requests", "detail": "slower"}'
    with (
        Client(server(lambda _: (429, problem, {"Retry-After": "600"}))) as client,
        pytest.raises(ApiError, match="slower") as caught,
    ):
        list(client.all_jobs())
    assert (caught.value.status, caught.value.retry_after_s) == (429, 600)


def test_an_answer_that_does_not_come_is_not_waited_for_for_ever(
    server: Callable[[Answers], str],
) -> None:
    left = threading.Event()

    def answers(_: int) -> tuple[int, bytes, dict[str, str]]:
        left.wait(600)
        return 200, _NO_JOBS, {}

    with (
        Client(server(answers), patience_s=0, timeout_s=0.3) as client,
        pytest.raises(Unreachable, match=r"timed out|silent"),
    ):
        list(client.all_jobs())
    left.set()


def test_the_package_offers_the_client_without_loading_it() -> None:
    program = (
        "import plateau, sys; before = set(sys.modules);"
        "assert 'Client' in dir(plateau) and 'httpx' not in before;"
        "from plateau import *; assert Client.__module__.startswith('plateau.client');"
        "assert JobSpec().rule == JodSpec() and JobState('queued')"
    )
    subprocess.run([sys.executable, "-c", program], check=True)
    with pytest.raises(ImportError):
        from plateau import Klient  # noqa: F401


def test_a_command_is_not_for_a_service_of_another_version(
    server: Callable[[Answers], str],
) -> None:
    url = server(lambda _: (200, _NO_JOBS, {"Plateau-Version": "7.3.1"}))
    says = f"this is Plateau {versions.plateau()}, and the service at {url} is Plateau 7.3.1"
    with connect(url) as client, pytest.raises(OtherVersion, match=says):
        list(client.all_jobs())
    done = CliRunner().invoke(app, ["list", "--url", url])
    assert done.exit_code == ExitCode.INCOMPATIBLE


@pytest.mark.parametrize("status", [502, 503, 504])
def test_a_command_waits_for_a_service_that_it_has_heard(
    server: Callable[[Answers], str], status: int
) -> None:
    # Given a service that answers, and is away for two requests then, perhaps behind a proxy
    away = (status, b"", {"Retry-After": "0"})
    url = server(lambda asked: away if asked in {1, 2} else (200, _NO_JOBS, {}))
    with connect(url) as client:
        list(client.all_jobs())
        assert list(client.all_jobs()) == []
    # But not for one that was away from the first
    with connect(server(lambda _: away)) as client, pytest.raises(ApiError):
        list(client.all_jobs())
