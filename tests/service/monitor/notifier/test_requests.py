"""A notice's request is signed, goes to the address that was checked, and never lasts for long."""

import itertools
import socket
import socketserver
import ssl
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from datetime import datetime, timedelta, timezone
from types import SimpleNamespace
from urllib.parse import urlsplit

import httpcore
import pytest
import trustme
from standardwebhooks import Webhook, WebhookVerificationError

from plateau.service.monitor.notifier import requests as module
from plateau.service.monitor.notifier.requests import NoResponse, Requests, signed_headers
from plateau.service.notices.receivers import Receivers
from tests.support.farms.receiver import OK, SECRET, Answer, receiving
from tests.support.threads import working

BODY = b'{"type": "job.converged"}'
HERE = Receivers(("127.0.0.0/8",))
NEVER_S = 600  #: longer than a test may take


def headers(body: bytes = BODY) -> dict[str, str]:
    return signed_headers("msg_1", datetime.now(timezone.utc), body, SECRET)


def requests(receivers: Receivers = HERE, **times: float) -> Requests:
    return Requests(receivers, **times)


@pytest.fixture(scope="session")
def authority() -> trustme.CA:
    return trustme.CA()


def serving(authority: trustme.CA, name: str) -> ssl.SSLContext:
    tls = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    authority.issue_cert(name).configure_cert(tls)
    return tls


@contextmanager
def speaking(words: Iterable[bytes], pause_s: float = 0.0) -> Iterator[str]:
    """The URL of a server that says these words to whoever connects, with pauses, and stays."""
    over = threading.Event()

    class Talk(socketserver.BaseRequestHandler):
        def handle(self) -> None:
            with suppress(OSError):
                for word in words:
                    self.request.sendall(word)
                    if over.wait(pause_s):
                        return
                over.wait(NEVER_S)

    server = socketserver.ThreadingTCPServer(("127.0.0.1", 0), Talk)
    with server, working(server.serve_forever, lambda: (over.set(), server.shutdown())):
        yield f"http://127.0.0.1:{server.server_address[1]}/"


def test_a_signature_is_what_the_library_of_standard_webhooks_expects() -> None:
    assert Webhook(SECRET).verify(BODY, headers()) == {"type": "job.converged"}
    then = datetime.now(timezone.utc) - timedelta(minutes=10)
    for secret, body, signed in (
        (SECRET, BODY + b" ", headers()),
        (f"whsec_{'A' * 43}=", BODY, headers()),
        (SECRET, BODY, signed_headers("msg_1", then, BODY, SECRET)),
    ):
        with pytest.raises(WebhookVerificationError):
            Webhook(secret).verify(body, signed)


class TestARequest:
    def test_arrives_as_it_was_signed(self) -> None:
        with receiving() as receiver:
            assert requests().post(receiver.url, headers(), BODY).status == 200
        [received] = receiver.received
        assert received.path == "/hook?from=plateau"
        assert received.body == BODY
        assert received.headers["host"] == urlsplit(receiver.url).netloc
        assert received.headers["content-type"] == "application/json"
        assert received.headers["user-agent"].startswith("Plateau/")
        received.verified()

    def test_knows_no_proxy(self, monkeypatch: pytest.MonkeyPatch) -> None:
        with receiving() as proxy, receiving() as receiver:
            for name in ("http_proxy", "https_proxy", "all_proxy", "HTTP_PROXY", "ALL_PROXY"):
                monkeypatch.setenv(name, proxy.url)
            requests().post(receiver.url, headers(), BODY)
            assert (len(receiver.received), len(proxy.received)) == (1, 0)

    def test_hears_when_it_is_to_be_tried_again(self) -> None:
        with receiving(lambda *_: (429, {"Retry-After": "120"})) as receiver:
            assert requests().post(receiver.url, headers(), BODY).retry_after_s == 120
        for odd in ("-1", "soon", "1" * 40, "Fri, 21 Nov 2036 12:00:00 GMT"):
            with receiving(lambda *_, odd=odd: (503, {"Retry-After": odd})) as receiver:
                assert requests().post(receiver.url, headers(), BODY).retry_after_s == 0


class TestTheGuard:
    def test_connects_to_the_address_that_it_checked(self) -> None:
        """A name that is a public address when asked first, and this machine from then on."""
        asked: list[str] = []

        def rebinding(host: str, port: int) -> list[str]:
            asked.append(host)
            return ["192.0.2.1" if len(asked) == 1 else "127.0.0.1"]

        with receiving() as receiver:
            port = urlsplit(receiver.url).port
            # The first address is allowed here, and nobody is there
            receivers = Receivers(("192.0.2.1",), look_up=rebinding)
            with pytest.raises(NoResponse):
                requests(receivers, connect_s=0.5).post(
                    f"http://evil.example:{port}/", headers(), BODY
                )
            assert asked == ["evil.example"]
            # At the next try the name is asked again, and refused for what it means now
            with pytest.raises(NoResponse, match="no public address"):
                requests(receivers).post(f"http://evil.example:{port}/", headers(), BODY)
            assert receiver.received == []

    def test_tries_the_other_addresses_of_a_host(self) -> None:
        receivers = Receivers(("127.0.0.0/8",), look_up=lambda *_: ["127.0.0.2", "127.0.0.1"])
        with receiving() as receiver:
            url = f"http://hooks.lab:{urlsplit(receiver.url).port}/"
            assert requests(receivers).post(url, headers(), BODY).status == 200


def test_tls_is_verified_against_the_name_whatever_the_address(
    authority: trustme.CA, monkeypatch: pytest.MonkeyPatch
) -> None:
    receivers = Receivers(("hooks.lab",), look_up=lambda *_: ["127.0.0.1"])
    tls = ssl.create_default_context()
    authority.configure_trust(tls)
    theirs = Requests(receivers, lambda: tls)
    with receiving(tls=serving(authority, "hooks.lab")) as receiver:
        url = f"https://hooks.lab:{urlsplit(receiver.url).port}/x"
        assert theirs.post(url, headers(), BODY).status == 200
        receiver.received[0].verified()
    # Another name, and an unknown authority, are refused
    with receiving(tls=serving(authority, "other.lab")) as receiver:
        url = f"https://hooks.lab:{urlsplit(receiver.url).port}/x"
        with pytest.raises(NoResponse, match="certificate verify failed"):
            theirs.post(url, headers(), BODY)
        assert receiver.received == []
    with receiving(tls=serving(authority, "127.0.0.1")) as receiver:
        with pytest.raises(NoResponse, match="certificate verify failed"):
            requests().post(receiver.url, headers(), BODY)
        assert receiver.received == []
        # But for one that the environment names
        with authority.cert_pem.tempfile() as bundle:
            monkeypatch.setenv("SSL_CERT_FILE", bundle)
            assert requests().post(receiver.url, headers(), BODY).status == 200


def test_what_never_ends_or_never_begins_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    body = b"HTTP/1.1 200 OK\r\nContent-Length: 1000000000\r\n\r\n" + b"x" * 1_000_000
    with speaking([body]) as url:
        assert requests(total_s=NEVER_S).post(url, headers(), BODY).status == 200
    # Time is over when its body is to be read
    now_s, read_some = [0.0], module._read_some

    def read_late(response: httpcore.Response) -> None:
        now_s[0] = 1e9
        read_some(response)

    with (
        speaking([b"HTTP/1.1 500 Oh\r\nContent-Length: 10\r\n\r\n"]) as url,
        monkeypatch.context() as patch,
    ):
        patch.setattr(module, "time", SimpleNamespace(monotonic=lambda: now_s[0]))
        patch.setattr(module, "_read_some", read_late)
        assert requests(total_s=60).post(url, headers(), BODY).status == 500
    flood = b"HTTP/1.1 200 OK\r\n" + b"x: " + b"y" * 2_000_000
    with speaking([flood]) as url, pytest.raises(NoResponse):
        requests(total_s=5).post(url, headers(), BODY)
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
    with pytest.raises(NoResponse, match="refused"):
        requests().post(f"http://127.0.0.1:{port}/", headers(), BODY)


class TestTime:
    def test_a_receiver_that_hangs(self, monkeypatch: pytest.MonkeyPatch) -> None:
        # For the socket's own limit alone
        monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: 0.0))
        left = threading.Event()

        def wait(*_: object) -> Answer:
            left.wait(NEVER_S)
            return OK

        with receiving(wait) as receiver:
            with pytest.raises(NoResponse, match=r"no answer within 2 s"):
                requests(total_s=2).post(receiver.url, headers(), BODY)
            left.set()

    def test_an_answer_that_comes_drop_by_drop(self) -> None:
        # Each drop comes in time, and all of them never
        with speaking(itertools.repeat(b"H"), pause_s=0.2) as url, pytest.raises(NoResponse):
            requests(total_s=1.5).post(url, headers(), BODY)
        # Nor is it one that is no HTTP
        with speaking([b"220 mail.example ESMTP\r\n"]) as url, pytest.raises(NoResponse):
            requests(total_s=2).post(url, headers(), BODY)
