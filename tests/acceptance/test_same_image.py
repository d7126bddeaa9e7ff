"""The image and the curve do not depend on who rendered them, nor on who died on the way."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from plateau.farm.images.exr import Pixels
from plateau.farm.model.seeds import SeedSchedule
from plateau.farm.wire.views import JobView
from plateau.worker.supervisor.variants import choose
from tests.support.farms.real_farm import BOX, RealFarm
from tests.support.until import until

SIZE = 48
SPEC = {
    "parameters": {"width": SIZE, "height": SIZE},
    "step": 40,
    "slice_spp": 20,
    "max_spp": 1200,
    "rule": {"name": "reverse", "window": 5, "epsilon": 4.0},
}
Outcome = tuple[JobView, list[dict[str, object]], Pixels]


def outcome(farm: RealFarm, job: JobView) -> Outcome:
    done = farm.client.wait(job.id)
    return done, farm.curve(job), farm.image(job)


def assert_same(one: Outcome, other: Outcome) -> None:
    assert (one[0].state, one[0].spp) == (other[0].state, other[0].spp)
    assert one[1] == other[1]
    assert one[2].tobytes() == other[2].tobytes()


@pytest.fixture(scope="module")
def undisturbed(shared_farm: RealFarm) -> Outcome:
    """One worker, nothing happens."""
    shared_farm.start("monitor")
    shared_farm.workers(1)
    found = outcome(shared_farm, shared_farm.submit(**SPEC))
    shared_farm.stop_all()
    return found


def test_it_converges_below_the_cap(undisturbed: Outcome) -> None:
    job, curve, _ = undisturbed
    assert (job.state, job.variant is not None) == ("converged", True)
    assert job.spp < 1200
    assert [point["spp"] for point in curve] == list(range(40, job.spp + 1, 40))
    assert all(point["estimate_pixels"] is not None for point in curve)


def test_more_workers_make_the_same_image(farm: RealFarm, undisturbed: Outcome) -> None:
    farm.start("monitor")
    farm.workers(3)
    until(lambda: len(farm.client.workers()) == 3)

    def several_render_it() -> bool:
        job = farm.submit(**SPEC)
        assert_same(outcome(farm, job), undisturbed)
        return len({part.worker for part in farm.client.slices(job.id)}) > 1

    until(several_render_it)  # the first may be done before a second worker is warm


def test_it_is_what_mitsuba_renders_in_one_process(undisturbed: Outcome, cache: Path) -> None:
    job, _, image = undisturbed
    schedule = SeedSchedule(str(job.variant), SIZE, SIZE, 20, 1200)
    passes = [[tuple(one) for one in schedule.passes(index)] for index in range(job.spp // 20)]
    program = """
import sys, json, numpy as np
from plateau.worker.renderers.contract import Load
from plateau.worker.renderers.mitsuba.renderer import Renderer
variant, size, passes, into = json.loads(sys.stdin.read())
renderer = Renderer(variant, threads=2)
shape = {"width": str(size), "height": str(size)}
scene = {"folder": sys.argv[1], "entry": "scene.xml", "parameters": shape}
renderer.load(Load(**scene, sensor=0, threads=1))
total = np.zeros(())
for slice_ in passes:
    film = 0.0
    for one in renderer.render(slice_, is_cancelled=lambda: False):
        film = film + one.astype(np.float64)
    total = total + film.astype(np.float32).astype(np.float64)
np.save(into, (total[..., :3] / total[..., 3:]).astype(np.float32))
"""
    library = choose(cache).llvm_library
    into = cache / "in-one-process.npy"
    subprocess.run(
        [sys.executable, "-c", program, str(BOX)],
        input=json.dumps([job.variant, SIZE, passes, str(into)]),
        text=True,
        check=True,
        env={**os.environ, **({"DRJIT_LIBLLVM_PATH": library} if library else {})},
    )
    np.testing.assert_array_equal(np.load(into), image)
