"""Folders are synced whenever they may have changed, whoever changed them."""

import os
from pathlib import Path

import pytest

from plateau.farm.process import durable
from plateau.farm.process.durable import FolderSync, make_folder, sync_tree

OLD = (1e9, 1e9)


@pytest.fixture
def synced(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """What was synced, in order."""
    paths: list[Path] = []
    sync = durable.sync

    def noting(path: Path) -> None:
        paths.append(path)
        sync(path)

    monkeypatch.setattr(durable, "sync", noting)
    return paths


def test_every_folder_up_to_the_root_is_synced(synced: list[Path], tmp_path: Path) -> None:
    root, leaf = tmp_path / "root", tmp_path / "root" / "a" / "b"
    leaf.mkdir(parents=True)
    FolderSync(root).up_from(leaf)
    assert synced == [leaf, leaf.parent, root]


def test_one_that_was_removed_meanwhile_is_no_error(synced: list[Path], tmp_path: Path) -> None:
    FolderSync(tmp_path).up_from(tmp_path / "gone" / "too")
    assert synced == [tmp_path]
    # But for the root: what is on a disk that went is not safe
    with pytest.raises(FileNotFoundError):
        FolderSync(tmp_path / "gone").up_from(tmp_path / "gone")


def test_one_that_has_not_changed_since_is_not_synced_again(
    synced: list[Path], tmp_path: Path
) -> None:
    folders = FolderSync(tmp_path)
    os.utime(tmp_path, OLD)
    folders.up_from(tmp_path)
    folders.up_from(tmp_path)
    assert synced == [tmp_path]
    # But if anybody puts something into it, it is
    (tmp_path / "new").mkdir()
    folders.up_from(tmp_path)
    assert synced == [tmp_path] * 2


def test_one_that_has_just_changed_may_do_so_again(synced: list[Path], tmp_path: Path) -> None:
    os.utime(tmp_path, (2.1e9, 2.1e9))  # just now, however long a sync takes
    folders = FolderSync(tmp_path)
    for _ in range(3):
        folders.up_from(tmp_path)
    assert synced == [tmp_path] * 3


def test_another_folder_of_the_same_name_is_synced(synced: list[Path], tmp_path: Path) -> None:
    folders, folder = FolderSync(tmp_path), tmp_path / "a"
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        os.utime(tmp_path / name, OLD)
    folders.up_from(folder)
    (tmp_path / "b").rename(folder)
    os.utime(folder, OLD)
    synced.clear()
    folders.up_from(folder)
    assert folder in synced


def test_a_new_folder_is_synced_into_the_one_above(synced: list[Path], tmp_path: Path) -> None:
    make_folder(tmp_path / "a" / "b")
    assert synced == [tmp_path, tmp_path / "a"]
    make_folder(tmp_path / "a" / "b")
    assert len(synced) == 2


def test_all_of_a_tree_is_synced(synced: list[Path], tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "file").write_bytes(b"x")
    sync_tree(tmp_path)
    assert set(synced) == {tmp_path, tmp_path / "a", tmp_path / "a" / "file"}
