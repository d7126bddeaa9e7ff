"""The blobs of a run, as a node has them: the store of the front, over HTTP."""

import io
from collections.abc import Iterator
from contextlib import closing
from http.client import HTTPConnection
from pathlib import Path

import pytest

from plateau.engines.blob_server import serving
from plateau.farm.blobs.store import Blobs
from plateau.farm.model.errors import BlobsUnavailable
from tests.support.blob_contract import BIG


@pytest.fixture
def kept(tmp_path: Path) -> Blobs:
    """The front's own store."""
    made = Blobs(str(tmp_path / "blobs"))
    made.make_mark("ours")
    return made


@pytest.fixture
def port(kept: Blobs) -> Iterator[int]:
    with serving(kept, "secret") as port:
        yield port


@pytest.fixture
def store(port: int) -> Blobs:
    return Blobs(f"http://secret@127.0.0.1:{port}")


@pytest.mark.parametrize("content", [b"", b"scene", BIG], ids=["empty", "small", "big"])
@pytest.mark.parametrize("kind", [bytes, io.BytesIO])
def test_a_node_puts_and_gets_what_the_front_has(
    store: Blobs, kept: Blobs, content: bytes, kind: type
) -> None:
    store.put("jobs/j/partials/a b.exr", kind(content))
    assert kept.get("jobs/j/partials/a b.exr") == content
    kept.put("scenes/ab", content)
    assert store.get("scenes/ab") == b"".join(store.chunks("scenes/ab")) == content
    assert (store.mark(), store.size("scenes/ab"), store.size("nothing")) == (
        "ours",
        len(content),
        None,
    )
    store.delete("scenes/ab", "nothing")
    assert not kept.exists("scenes/ab")


def test_a_missing_blob_is_a_missing_file_and_a_name_leads_nowhere_else(
    store: Blobs, port: int, tmp_path: Path
) -> None:
    with pytest.raises(FileNotFoundError, match=r"^the blob store has no nothing$"):
        next(store.chunks("nothing"))
    (tmp_path / "secret").write_text("no blob")
    with closing(HTTPConnection("127.0.0.1", port)) as front:
        for path in ("/../secret", "/jobs/..%2f../../secret", f"/{tmp_path}/secret"):
            front.request("GET", path, headers={"Authorization": "Bearer secret"})
            answer = front.getresponse()
            assert (answer.status, answer.read()) == (404, b"")


def test_who_does_not_know_the_secret_learns_and_changes_nothing(port: int, kept: Blobs) -> None:
    kept.put("scenes/ab", b"scene")
    stranger = Blobs(f"http://guessed@127.0.0.1:{port}")
    for attempt in (
        stranger.mark,
        lambda: stranger.get("scenes/ab"),
        lambda: stranger.put("scenes/ab", b"another"),
        lambda: stranger.put("scenes/ab", BIG),
        lambda: stranger.delete("scenes/ab"),
    ):
        with pytest.raises(BlobsUnavailable):
            attempt()
    assert kept.get("scenes/ab") == b"scene"


def test_a_front_that_has_gone_is_an_error_and_no_missing_blob(kept: Blobs) -> None:
    with serving(kept, "secret") as port:
        store = Blobs(f"http://secret@127.0.0.1:{port}")
        kept.put("scenes/ab", b"scene")
        assert store.get("scenes/ab") == b"scene"
    with pytest.raises(BlobsUnavailable, match="the blob store failed"):
        store.get("scenes/ab")
