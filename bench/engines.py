"""A farm that comes and goes: the same job here, and on 1, 2 and 4 nodes of Slurm and of Ray.

Measured are the time from the call of `plateau.rendering.own_farm` to the first committed slice,
and for which share of the time that nodes were taken they rendered. All nodes are on this machine,
where Ray is installed and Slurm runs, such as that of the tests::

    PYTHON=.cluster-tools/ray/bin/python
    $PYTHON -m tests.cluster.support_slurm $PYTHON -m bench.engines
"""

import hashlib
import os
import secrets
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import psutil

from bench.support.processes import timed
from bench.support.report import machine_table, write_report
from plateau.client.events import is_rendered
from plateau.engines.front import VARIABLE
from plateau.farm.images.exr import decode_image
from plateau.farm.model.spec import FixedSpec, JobSpec
from plateau.processes.interrupts import Interrupts
from plateau.rendering.own_farm import checked_settings, own_farm
from plateau.scenes import path_of

_OURS: Final = "PLATEAU_BENCH"  #: what our nodes have in their environment, new for each run


@dataclass(frozen=True, kw_only=True)
class Plan:
    """What is rendered, and where."""

    engines: tuple[str, ...] = ("slurm", "ray")
    workers: tuple[int, ...] = (1, 2, 4)  #: of one thread each
    size: int = 256  #: of the image, in pixels
    spp: int = 400


@dataclass(frozen=True)
class Run:
    """What was measured of one run; times in seconds."""

    first_s: float  #: from the call to the first slice in the ledger
    total_s: float  #: and until the farm has gone
    share: str  #: of the lives of the nodes' processes, what they rendered
    sha256: str  #: of the image's pixels
    others: float  #: the share of the cores that other work took, and the nodes


def main() -> None:
    plan = Plan()
    found = measure(plan)
    rows = [
        [name, f"{run.first_s:.1f}", f"{run.total_s:.1f}", run.share] for name, run in found.items()
    ]
    settings = {"image": f"{plan.size}×{plan.size}, {plan.spp} spp"}
    tables = {
        "engines": [["", "first slice, s", "all of it, s", "share of node time"], *rows],
        "engines-machine": machine_table(settings, [run.others for run in found.values()][:1]),
    }
    write_report("engines", tables, settings=settings, document="performance.md")


def measure(plan: Plan) -> dict[str, Run]:
    """Measure every run, by its name; raise if an image is not that of the first."""
    render(plan, None, 1)  # compiles, and reads files
    found = {"this machine, 1 worker": render(plan, None, 1)}
    for engine in plan.engines:
        with _ray() if engine == "ray" else nullcontext():
            for workers in plan.workers:
                name = f"{engine}, {workers} worker{'s' * (workers > 1)}"
                found[name] = render(plan, engine, workers)
                print(name, found[name], flush=True)
    if len({run.sha256 for run in found.values()}) > 1:
        raise AssertionError(f"the images differ: {found}")
    return found


def render(plan: Plan, on: str | None, workers: int) -> Run:
    """Render the job once, on a farm of its own."""
    spec = JobSpec(
        parameters={"width": str(plan.size), "height": str(plan.size)},
        rule=FixedSpec(spp=plan.spp),
        allocation={"name": "frame"},
    )
    scene = path_of(Path("scenes:box"))
    settings = checked_settings(scene, spec, on)
    with timed() as took, _taken() as nodes:
        began, first = time.time(), 0.0
        with (
            Interrupts(signal.SIGINT) as asked,
            own_farm(settings, asked, spec, workers=workers, threads=1, tell=print, on=on) as farm,
        ):
            job = farm.client.submit(scene, spec)
            for event in farm.client.events(job.id):
                farm.check()
                first = first or (event.at.timestamp() if event.type == "slice" else 0.0)
                if is_rendered(event):
                    farm.give_back()
            job = farm.client.job(job.id)
            image = decode_image(farm.client.image(job.id, "image.exr")).tobytes()
    nodes_s = sum(end - start for start, end in nodes.values())
    share = f"{job.machine_s / nodes_s:.0%}" if nodes_s else "–"
    return Run(first - began, took.wall_s, share, hashlib.sha256(image).hexdigest(), took.others)


@contextmanager
def _taken() -> Iterator[dict[int, tuple[float, float]]]:
    """From when to when each process of a node lived, meanwhile: by its process id."""
    lived: dict[int, tuple[float, float]] = {}
    over = threading.Event()
    ours = os.environ[_OURS] = secrets.token_hex()

    def look() -> None:
        while not over.wait(0.05):
            for one in psutil.process_iter():
                with suppress(psutil.Error):
                    told = {} if one.name() == "sbatch" else one.environ()
                    if one.pid in lived or (VARIABLE in told and told.get(_OURS) == ours):
                        lived[one.pid] = lived.get(one.pid, (time.time(), 0))[0], time.time()

    thread = threading.Thread(target=look, daemon=True)
    thread.start()
    yield lived
    over.set()
    thread.join()


@contextmanager
def _ray() -> Iterator[None]:
    """A Ray of four processors, which is there before the command."""
    import ray

    ray.init("local", num_cpus=4, include_dashboard=False, log_to_driver=False)
    yield
    ray.shutdown()


if __name__ == "__main__":
    main()
