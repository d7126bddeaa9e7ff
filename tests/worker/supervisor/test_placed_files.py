"""A worker renders a scene where it lies, from the very files that it was submitted with."""

import hashlib
import io
import os
from pathlib import Path

import numpy as np
import pytest
import redis

from plateau.farm.blobs import names as blobs
from plateau.farm.blobs.store import Blobs
from plateau.farm.bundle import BundleLimits
from plateau.farm.bundle.hashes import FileHashes
from plateau.farm.bundle.placing import find_placed, write_placed
from plateau.farm.images.exr import decode_partial
from plateau.farm.ledger.workers import Workers
from plateau.farm.model.errors import FilesDiffer
from plateau.farm.model.job import Job
from plateau.farm.model.scene_roots import read_roots
from plateau.worker.supervisor.placed_files import PlacedFiles
from plateau.worker.supervisor.scene_cache import SceneCache
from tests.support.farms.bench import SCENE, Bench
from tests.support.scenes.bundles import ply
from tests.support.until import until

QUAD = ply("-1 -1 3, 1 -1 3, 1 1 3, -1 1 3", "3 0 2 1, 3 0 3 2")
SPHERE = '<shape type="sphere"><transform name="to_world"><translate z="4"/></transform>'
PLY = '<shape type="ply"><string name="filename" value="$mesh"/>'


@pytest.fixture
def assets(tmp_path: Path) -> Path:
    """The root `assets` as the API sees it."""
    assets = tmp_path / "api" / "assets"
    (assets / "walk").mkdir(parents=True)
    text = SCENE.format(integrator="path").replace(SPHERE, PLY)
    default = f'<default name="mesh" value="{assets}/quad.ply"/><default name="size"'
    (assets / "walk" / "scene.xml").write_text(text.replace('<default name="size"', default))
    (assets / "quad.ply").write_bytes(QUAD)
    return assets


def bundled(assets: Path) -> bytes:
    roots, target = read_roots(f"assets={assets}"), io.BytesIO()
    values = [{}, {"mesh": "{assets}/quad.ply"}]
    found = find_placed("{assets}/walk", roots, values, BundleLimits())
    write_placed(found, roots, FileHashes(assets.parent / "hashes"), target)
    return target.getvalue()


class Studio(Bench):
    """A farm whose workers see the root under paths of their own."""

    def placed_job(self, bundle: bytes, **spec: object) -> Job:
        return self.job(slices=1, scene=bundle, requires=("root.assets",), **spec)[0]

    def next_worker_sees(self, name: str, content: bytes) -> Path:
        root = self.settings.cache.parent / name
        root.mkdir()
        (root / "quad.ply").write_bytes(content)
        roots = read_roots(f"assets={root},plates={root}/none")
        self.settings = self.settings.model_copy(update={"scene_roots": roots})
        return root


@pytest.fixture
def studio(client: redis.Redis, redis_url: str, store: Blobs, tmp_path: Path) -> Studio:
    return Studio(client, redis_url, store, tmp_path)


def test_it_is_rendered_from_the_files_in_the_root(studio: Studio, assets: Path) -> None:
    bundle = bundled(assets)
    # Given a worker for which the root lies elsewhere
    studio.next_worker_sees("here", QUAD)
    # When two jobs name the same file: by the scene's absolute path, and by a parameter
    jobs = [
        studio.placed_job(bundle),
        studio.placed_job(bundle, parameters={"mesh": "{assets}/quad.ply"}),
    ]
    with studio.worker():
        until(lambda: all(studio.jobs.ledger(job.id) for job in jobs))
        # It says which roots it has: of those of its settings, the one that is there
        (about,) = Workers(studio.client).living()
        assert about.tags == ("root.assets",)
    # Then both have the same bits, and the mesh is in them
    blob_names = (studio.jobs.ledger(job.id)[0]["blob"] for job in jobs)
    first, second = (decode_partial(studio.store.get(name)).pixels for name in blob_names)
    assert np.array_equal(first, second)
    middle = first[8, 8]
    assert 0.4 < middle[0] / middle[-1] < 0.6  # the mesh, before a sky of 1


def test_a_worker_that_sees_another_file_does_not_render_it(studio: Studio, assets: Path) -> None:
    bundle = bundled(assets)
    studio.next_worker_sees("other", QUAD.replace(b"1 1 3", b"2 1 3"))
    with studio.worker() as other:
        job = studio.placed_job(bundle)
        until(lambda: studio.jobs.log(job.id))
        (refused,) = studio.jobs.log(job.id)
        assert (refused.what, refused.worker) == ("handed-back", other.id)
        assert str(refused.cause) == (
            "this worker does not see the scene as it was submitted: {assets}/quad.ply has other "
            "content"
        )
        # It is left out of the job, and the job waits for another
        left_out = {one.id: one.left_out_of for one in Workers(studio.client).living()}
        assert (left_out[other.id], studio.jobs.get(job.id).state.ended) == ((job.id,), False)
        studio.next_worker_sees("same", QUAD)
        with studio.worker() as same:
            until(lambda: studio.jobs.ledger(job.id))
        assert studio.jobs.ledger(job.id)[0]["worker"] == same.id


def test_files_are_compared_before_each_load(store: Blobs, assets: Path, tmp_path: Path) -> None:
    bundle = bundled(assets)
    sha256 = hashlib.sha256(bundle).hexdigest()
    store.put(blobs.scene(sha256), bundle)
    placed = PlacedFiles(read_roots(f"assets={assets}"), FileHashes(tmp_path / "hashes"))
    folder, entry = SceneCache(store, tmp_path / "cache", 600, placed).scene(sha256)
    assert placed.link(folder) == ("assets",)
    quad = folder / "assets" / "quad.ply"
    assert (quad.is_symlink(), quad.read_bytes(), entry) == (True, QUAD, "assets/walk/scene.xml")
    assert f'value="{folder}/assets/quad.ply"' in (folder / entry).read_text()
    # Another content of the same size and time
    status = (assets / "quad.ply").stat()
    (assets / "quad.ply").write_bytes(QUAD.replace(b"1 1 3", b"2 1 3"))
    os.utime(assets / "quad.ply", ns=(status.st_atime_ns, status.st_mtime_ns))
    with pytest.raises(FilesDiffer, match="has other content"):
        placed.link(folder)
    # A link that leads out of the root, though to the same content
    (tmp_path / "outside.ply").write_bytes(QUAD)
    (assets / "quad.ply").unlink()
    with pytest.raises(FilesDiffer, match="is missing"):
        placed.link(folder)
    (assets / "quad.ply").symlink_to(tmp_path / "outside.ply")
    with pytest.raises(FilesDiffer, match="a link that leads out of its root"):
        placed.link(folder)
    with pytest.raises(FilesDiffer, match="in a root that it does not have"):
        PlacedFiles((), FileHashes(tmp_path / "hashes")).link(folder)
    # As it was
    (assets / "quad.ply").unlink()
    (assets / "quad.ply").write_bytes(QUAD)
    assert placed.link(folder) == ("assets",)
