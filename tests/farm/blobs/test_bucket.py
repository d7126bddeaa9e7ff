"""S3 stores that are misconfigured, odd or away: one clear error each, and never a secret in it.

That a store which works does what it must is held against real servers, in tests/cluster.
"""

import io
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from datetime import timedelta

import pytest

from plateau.farm.blobs.bucket import RETRIES, TIMES
from plateau.farm.blobs.names import MARK
from plateau.farm.blobs.store import Blobs
from plateau.farm.model.errors import BlobsUnavailable
from tests.support.faults.odd_s3 import OddS3, error
from tests.support.until import until

SECRET = "the-secret-of-this-test"


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Iterator[OddS3]:
    for name in ("AWS_ENDPOINT_URL_S3", "AWS_ENDPOINT", "AWS_SESSION_TOKEN", "AWS_CA_BUNDLE"):
        monkeypatch.delenv(name, raising=False)
    with OddS3() as server:
        monkeypatch.setenv("AWS_ENDPOINT_URL", server.endpoint)
        monkeypatch.setenv("AWS_ACCESS_KEY_ID", "anna")
        monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", SECRET)
        yield server


@pytest.fixture
def bucket(server: OddS3) -> Blobs:
    return Blobs("s3://bucket/plateau")


class TestAUrl:
    @pytest.mark.parametrize(
        "url", ["s3://", "s3:///prefix", "s3://bucket/a?region=x", "s3://b#a", "gs://b"]
    )
    def test_names_a_bucket_and_a_prefix(self, url: str) -> None:
        with pytest.raises(ValueError, match=r"s3://BUCKET/PREFIX"):
            Blobs(url)

    def test_has_no_credentials(self) -> None:
        with pytest.raises(ValueError, match="set AWS_ACCESS_KEY_ID and") as refused:
            Blobs(f"s3://anna:{SECRET}@bucket/plateau")
        assert SECRET not in str(refused.value)

    def test_needs_no_slash_at_its_end_and_no_prefix(self, server: OddS3) -> None:
        for url, name in (("s3://b", "/b/a"), ("s3://b/p/", "/b/p/a"), ("s3://b/p/q", "/b/p/q/a")):
            Blobs(url).put("a", b"x")
            assert server.objects.pop(name) == b"x"


@pytest.mark.parametrize(
    ("says", "words"),
    [
        (error(404, "NoSuchBucket"), "there is no such bucket: make it"),
        (error(403, "InvalidAccessKeyId"), "the store does not know this AWS_ACCESS_KEY_ID"),
        (error(404, "XAdminUserNotFound"), "the store does not know this AWS_ACCESS_KEY_ID"),
        (error(403, "SignatureDoesNotMatch"), "AWS_SECRET_ACCESS_KEY is not that of"),
        (error(400, "ExpiredToken"), "AWS_SESSION_TOKEN has expired"),
        (error(403, "RequestTimeTooSkewed"), "this machine's clock differs"),
        (error(403, "AccessDenied"), "the store does not allow that"),
        (error(503, "SlowDown"), "503 Service Unavailable, SlowDown"),
        ((404, b"default backend - 404"), "404 Not Found"),
        ((502, b"<html>Bad gateway</html>"), "502 Bad Gateway"),
        ((301, b""), "the bucket is in another region: set AWS_REGION"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_what_is_wrong_is_said_in_a_line(
    server: OddS3, monkeypatch: pytest.MonkeyPatch, says: tuple[int, bytes], words: str
) -> None:
    monkeypatch.setitem(RETRIES, "max_retries", 0)
    bucket = Blobs("s3://bucket/plateau")
    server.says = says
    for ask in (
        lambda: bucket.get("scenes/a"),
        lambda: bucket.size("scenes/a"),
        lambda: next(bucket.chunks("scenes/a")),
        lambda: bucket.put("scenes/a", b"x"),
        lambda: bucket.names(""),
        bucket.mark,
        lambda: bucket.create("scenes/a", b"x"),
    ):
        with pytest.raises(BlobsUnavailable) as failed:
            ask()
        said = str(failed.value)
        assert words in said
        assert "\n" not in said
        assert SECRET not in said


def test_a_gateway_that_knows_nothing_is_not_a_store_without_blobs(
    server: OddS3, bucket: Blobs
) -> None:
    bucket.make_mark("ours")
    bucket.put("scenes/a", b"x")
    other = Blobs(bucket.where)
    assert other.exists("scenes/a")
    for says in ((404, b""), (404, b"no such page"), error(404, "NoSuchBucket")):
        server.says = says
        for one in (bucket, other):
            with pytest.raises(BlobsUnavailable):
                one.get("scenes/a")
            with pytest.raises(BlobsUnavailable):
                one.exists("scenes/a")
    server.says = None
    assert bucket.get("scenes/a") == b"x"


class TestAnAnswerThatDoesNotSay:
    """Whether it was done is looked for in the store."""

    def test_whether_a_blob_was_created(self, server: OddS3, bucket: Blobs) -> None:
        # It was: the try whose answer was lost, and so the next one was told that there is one
        server.objects[f"/bucket/plateau/{MARK}"] = b"ours"
        assert bucket.create(MARK, b"ours")
        # It was by another
        assert not bucket.create(MARK, b"theirs")

    def test_whether_a_scene_was_put(
        self, server: OddS3, bucket: Blobs, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        # Given a store that does what it is asked and then says that it could not
        answer = server.answer

        def afterwards(method: str, path: str, body: bytes, *, creates: bool) -> tuple[int, bytes]:
            done = answer(method, path, body, creates=creates)
            return error(500, "InternalError") if method == "PUT" else done

        monkeypatch.setattr(server, "answer", afterwards)
        bucket.put_once("scenes/a", io.BytesIO(b"scene"), 5)
        assert bucket.create("scenes/b", b"scene")
        assert bucket.get("scenes/a") == b"scene"
        with pytest.raises(BlobsUnavailable, match="InternalError"):
            bucket.put("scenes/c", b"x")


@pytest.fixture
def hasty(bucket: Blobs, monkeypatch: pytest.MonkeyPatch) -> Blobs:
    """The same one, which has a mark, with less patience: each knows what the other does."""
    bucket.make_mark("ours")
    silence = timedelta(seconds=0.5)
    monkeypatch.setitem(TIMES, "read_timeout", silence)
    monkeypatch.setitem(RETRIES, "retry_timeout", silence)
    hasty = Blobs(bucket.where)
    hasty._place._gate = bucket._place._gate
    return hasty


def test_a_store_that_is_silent_is_given_up(server: OddS3, bucket: Blobs, hasty: Blobs) -> None:
    server.silent.set()
    started = time.monotonic()
    with pytest.raises(BlobsUnavailable, match="it does not answer"):
        hasty.get("scenes/a")
    with pytest.raises(BlobsUnavailable, match="it does not answer"):
        hasty.put("scenes/a", b"x")
    assert time.monotonic() - started < 120
    server.silent.clear()
    bucket.put("scenes/a", b"x")
    assert bucket.get("scenes/a") == b"x"


def test_while_a_store_is_silent_only_one_waits_for_it(
    server: OddS3, bucket: Blobs, hasty: Blobs
) -> None:
    server.silent.set()
    # Given one who has waited in vain
    with pytest.raises(BlobsUnavailable):
        hasty.size("scenes/a")
    # When many ask, then one waits, and finds out for all
    with ThreadPoolExecutor(8) as pool:
        asking = [pool.submit(bucket.size, "scenes/a") for _ in range(8)]
        until(lambda: sum(one.done() for one in asking) == 7)
        server.silent.clear()
    (failed,) = {type(one.exception()) for one in asking if one.exception() is not None}
    assert failed is BlobsUnavailable
    assert [one.result() for one in asking if one.exception() is None] == [None]
    assert bucket.size(MARK) == 4


def test_a_server_that_is_gone(server: OddS3, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:9")
    with pytest.raises(BlobsUnavailable, match=r"http://127\.0\.0\.1:9/bucket.*refused"):
        Blobs("s3://bucket").names("")


def test_http_is_spoken_to_an_http_endpoint_alone(
    server: OddS3, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("AWS_ENDPOINT_URL", server.endpoint.replace("http:", "https:"))
    with pytest.raises(BlobsUnavailable, match="it does not speak TLS"):
        Blobs("s3://bucket").names("")
    # The endpoint for S3 comes before the one for everything
    monkeypatch.setenv("AWS_ENDPOINT_URL_S3", server.endpoint)
    assert not Blobs("s3://bucket").exists("a")
