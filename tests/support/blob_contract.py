"""What every blob store must do: one suite for the folder, and for each S3 server that is tried."""

import io
from concurrent.futures import ThreadPoolExecutor

import pytest

from plateau.farm.blobs import names as blobs
from plateau.farm.blobs.names import MARK
from plateau.farm.blobs.store import Blobs
from plateau.farm.model.errors import BlobsUnavailable

#: Goes up in several parts where a store takes parts.
BIG = bytes(range(256)) * 50_000


class BlobContract:
    """Tests of a `store`, a fixture of whoever inherits them: empty, and not yet marked."""

    @pytest.mark.parametrize("content", [b"", b"scene", BIG], ids=["empty", "small", "big"])
    @pytest.mark.parametrize("kind", [bytes, io.BytesIO])
    def test_what_is_put_is_got(self, store: Blobs, content: bytes, kind: type) -> None:
        store.put(blobs.scene("ab"), kind(content))
        assert store.get("scenes/ab") == content
        assert b"".join(store.chunks("scenes/ab")) == content
        assert store.size("scenes/ab") == len(content)
        assert Blobs(store.where).get("scenes/ab") == content

    def test_a_put_replaces_what_is_there(self, store: Blobs) -> None:
        for content in (b"first", BIG, b"last", b"last"):
            store.put("jobs/j/a", content)
            assert store.get("jobs/j/a") == content
        assert store.names("") == ["jobs/j/a"]

    def test_a_missing_blob_is_a_missing_file(self, store: Blobs) -> None:
        for _ in range(2):
            assert not store.exists("nothing")
            assert store.size("nothing") is None
            with pytest.raises(FileNotFoundError, match=r"^the blob store has no nothing$"):
                store.get("nothing")
            with pytest.raises(FileNotFoundError, match=r"^the blob store has no nothing$"):
                next(store.chunks("nothing"))
            store.delete("nothing")
            store.make_mark("ours")  # and the same in a store that is in use

    def test_names_are_listed_by_prefix(self, store: Blobs) -> None:
        names = [blobs.partial("j", index, "w-1") for index in range(3)]
        for name in [*names, f"{blobs.results('j')}1/image.exr", blobs.partial("j2", 0, "w-1")]:
            store.put(name, b"x")
        assert sorted(store.names(blobs.partials("j"))) == names
        assert {blob.size for blob in store.listing("")} == {1}
        assert len(store.names("")) == 5
        assert store.names("jobs/none/") == []
        store.delete(*names)
        assert store.names(blobs.partials("j")) == []
        assert store.exists("jobs/j/results/1/image.exr")

    def test_many_blobs_are_removed_at_once(self, store: Blobs) -> None:
        names = [blobs.partial("j", index, "w-1") for index in range(30)]
        for name in names[::2]:
            store.put(name, b"x")
        store.put("jobs/j/kept", b"x")
        store.delete(*names)
        store.delete()
        assert store.names("") == ["jobs/j/kept"]

    def test_a_scene_is_stored_once(self, store: Blobs) -> None:
        store.put_once("scenes/ab", io.BytesIO(b"scene"), 5)
        store.put_once("scenes/ab", io.BytesIO(b"other"), 5)
        assert store.get("scenes/ab") == b"scene"
        # But if it was torn, it is put again
        store.put("scenes/ab", b"sc")
        store.put_once("scenes/ab", io.BytesIO(b"scene"), 5)
        assert store.get("scenes/ab") == b"scene"

    def test_of_many_who_create_a_blob_one_does(self, store: Blobs) -> None:
        with ThreadPoolExecutor(8) as pool:
            for round_ in range(5):
                contents = [b"racer %d" % racer for racer in range(8)]
                done = list(pool.map(store.create, [f"made/{round_}"] * 8, contents))
                assert done.count(True) == 1
                assert store.get(f"made/{round_}") == contents[done.index(True)]
                assert not store.create(f"made/{round_}", b"late")
                # And whoever did may ask again, not knowing of it
                assert store.create(f"made/{round_}", contents[done.index(True)])
        assert len(store.names("")) == 5

    def test_a_mark_stays(self, store: Blobs) -> None:
        assert store.mark() is None
        assert store.make_mark("ours") == "ours"
        assert Blobs(store.where).make_mark("theirs") == "ours"
        assert store.mark() == "ours"
        assert store.names("") == []  # it is nobody's blob

    def test_a_store_that_has_lost_its_mark_is_away_and_not_empty(self, store: Blobs) -> None:
        # Given a store in use, and a process that has just come
        store.make_mark("ours")
        store.put("scenes/a", b"x")
        newcomer = Blobs(store.where)
        assert newcomer.get("scenes/a") == b"x"
        # When all of it is gone, as from a disk that is not mounted
        store.delete(MARK, "scenes/a")
        # Then no blob is missing: the store is
        for one in (store, newcomer):
            for look in (
                lambda one: one.get("scenes/a"),
                lambda one: one.size("scenes/a"),
                lambda one: one.names("scenes/"),
                lambda one: list(one.chunks("scenes/a")),
                lambda one: one.put("scenes/b", b"x"),
                lambda one: one.put_once("scenes/b", io.BytesIO(b"x"), 1),
            ):
                with pytest.raises(BlobsUnavailable, match="is it still"):
                    look(one)
        assert Blobs(store.where).names("") == []
