"""A scene that kills whoever renders it ends its own job, with a reason, and hurts no other."""

import io
import re
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from plateau.farm.model.spec import JobSpec
from plateau.farm.wire.views import JobView
from tests.support.farms.faulty_farm import BRIEF, FaultyFarm
from tests.support.faults.invariants import check_job
from tests.support.long_tests import rare_among
from tests.support.scenes.bundles import ply
from tests.support.until import until

SCENE = """<scene version="3.0.0">
  <integrator type="path"><integer name="max_depth" value="{depth}"/>
    <integer name="rr_depth" value="{depth}"/></integrator>
  <sensor type="perspective"><film type="hdrfilm">
    <integer name="width" value="{size}"/><integer name="height" value="{size}"/>
    <rfilter type="box"/>
  </film></sensor>
  {body}
  <emitter type="constant"/>
</scene>"""

#: Its second face names a vertex that is not there; Mitsuba does not look, and the check of scenes
#: leaves so long a text to the worker.
WILD_MESH = ply(
    "-1 -1 3, 1 -1 3, 0 1 3",
    "3 0 1 2, 3 0 1 2000000000",
    comment="\n".join(["comment " + "-" * 1000] * 17_000),
)
#: A closed box, seen from within, in which light never gets lost.
HALL_OF_MIRRORS = """<shape type="cube"><boolean name="flip_normals" value="true"/>
  <bsdf type="conductor">
  <string name="material" value="none"/></bsdf></shape>"""


def bundle(path: Path, body: str, *, size: int = 16, depth: int = 4, **files: bytes) -> Path:
    """Write a scene and its files as a zip."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        archive.writestr("scene.xml", SCENE.format(body=body, size=size, depth=depth))
        for name, content in files.items():
            archive.writestr(name.replace("_", "."), content)
    path.write_bytes(stream.getvalue())
    return path


@pytest.fixture(scope="module")
def small_farm(tmp_path_factory: pytest.TempPathFactory, cache: Path) -> Iterator[FaultyFarm]:
    """A farm of two workers whose children may take little, and that tries a slice twice."""
    limits = {"PLATEAU_CHILD_MEMORY_GB": "1", "PLATEAU_CHILD_TIMEOUT_S": "60"}
    with FaultyFarm(tmp_path_factory.mktemp("small"), cache, **limits) as farm:
        for role in ("monitor", "worker", "worker"):
            farm.start_changed(role, set={"plateau.farm.ledger.queue:MAX_TRIES": 2})
        farm.wait_for_workers(2)
        yield farm


def ended(farm: FaultyFarm, job: JobView) -> JobView:
    until(lambda: farm.jobs.get(job.id).finished_at is not None, 240)
    check_job(farm.jobs, farm.store, farm.redis_client, job.id)
    return farm.client.job(job.id)


POISONS = {
    "it segfaults": (
        {"body": '<shape type="ply"><string name="filename" value="wild.ply"/></shape>'},
        {},
        "SIGSEGV",
    ),
    "a pass never ends": (
        {"body": HALL_OF_MIRRORS, "depth": 1_000_000, "size": 256},
        {},
        "longer than 60 s",
    ),
    "it wants more memory than there is": (
        {"body": "", "size": 6500},
        {"slice_spp": 1, "step": 1, "max_spp": 4},
        "[Mm]emory|SIGSEGV|SIGABRT",  # as it goes with whoever asked for it in vain
    ),
}


@pytest.mark.parametrize("poison", rare_among(POISONS, {"a pass never ends"}))
def test_a_poisonous_scene(small_farm: FaultyFarm, tmp_path: Path, poison: str) -> None:
    scene, spec, words = POISONS[poison]
    files = {"wild_ply": WILD_MESH} if "wild.ply" in str(scene["body"]) else {}
    path = bundle(tmp_path / "poison.zip", **scene, **files)  # type: ignore[arg-type]
    bad = small_farm.client.submit(path, JobSpec.model_validate({"priority": 1, **spec}))
    good = small_farm.submit(**BRIEF)
    failed = ended(small_farm, bad)
    assert failed.state == "failed"
    assert re.search(words, failed.reason), failed.reason
    # Nobody else is hurt: the other job converges, and both workers are as they were
    assert ended(small_farm, good).state == "converged"
    workers = small_farm.client.workers()
    assert len(workers) == 2
    assert all(worker.trouble is None for worker in workers)
    assert all(process.poll() is None for process in small_farm.processes)
