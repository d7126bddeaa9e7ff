"""The most memory that each process of a farm takes: `make bench-memory`.

For each size a farm of its own (`plateau up`, one worker) renders one job of a cheap scene with few
samples, and serves its images. Another farm of the same size then has many jobs at once, each with
five points of its curve. Their slices are made up, since a worker has one scene at a time: only the
monitor and the API take more for many jobs. Memory is the most that a process had resident, as the
kernel counts it (VmHWM), shared memory included.
"""

from __future__ import annotations

import argparse
import os
import re
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bench import STILL
from bench.support import markdown
from bench.support.farms.memory_farm import MADE_UP, made_up, peaks
from bench.support.farms.service_farm import ServiceFarm
from bench.support.report import Figure, figure, last_figures, write_report
from plateau.client import Client
from plateau.farm.model.spec import FixedSpec, JobSpec, Variant

if TYPE_CHECKING:
    from collections.abc import Mapping

_SCENE = STILL
SIZES = {"512²": (512, 512), "1080p": (1920, 1080), "2160p": (3840, 2160)}
#: The processes of the farms that render; the other leaves its worker idle.
ROLES = ("API", "monitor", "worker", "render child")
_STEP = 2
#: Of 1 spp: five points of the curve, so that `reverse` has stored the percept of the first image.
_SLICES = 10
_PATIENCE_S = 1200.0  #: until many large images have their points


@dataclass(frozen=True, kw_only=True)
class Plan:
    """The farms to be measured."""

    sizes: Mapping[str, tuple[int, int]] = field(default_factory=lambda: SIZES)
    #: How many jobs the second farm has at once.
    many: Mapping[str, int] = field(default_factory=lambda: dict.fromkeys(SIZES, 20))
    threads: int = field(default_factory=lambda: len(os.sched_getaffinity(0)))
    variant: Variant = "auto"


#: MB by size, by jobs at once, by role.
Found = dict[str, dict[int, dict[str, float]]]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sizes", nargs="+", choices=SIZES, default=list(SIZES))
    options = parser.parse_args()
    plan = Plan(sizes={name: SIZES[name] for name in options.sizes})
    others = [one for one in last_figures("memory") if _size_of(one) not in plan.sizes]
    made = [*figures(measure(plan)), *others]
    report = write_report(
        "memory",
        sorted(made, key=lambda one: list(SIZES).index(_size_of(one))),
        settings={"workers": 1, "threads": plan.threads, "slices": _SLICES},
        notes=[
            "Each row is a farm of its own, with an embedded Redis and local blobs.",
            "One job is rendered; the slices of many are made up: noise, committed as by a worker.",
            "Shared libraries are counted in each process.",
        ],
    )
    markdown.fill(markdown.DOCS / "operations.md", tables(report))


def _size_of(one: Figure) -> str:
    return re.split("[,:]", one.name)[0]


def measure(plan: Plan) -> Found:
    """Return the memory of each farm's processes."""
    found: Found = {}
    for name, (width, height) in plan.sizes.items():
        found[name] = {
            1: _one_rendered(plan, width, height),
            plan.many[name]: _many_made_up(plan, plan.many[name], width, height),
        }
        print(f"{name} done", file=sys.stderr)
    return found


def _one_rendered(plan: Plan, width: int, height: int) -> dict[str, float]:
    with tempfile.TemporaryDirectory() as folder:
        farm = ServiceFarm(Path(folder), jobs=0, threads=plan.threads)
        with farm, Client(farm.url) as client:
            spp = _SLICES
            spec = JobSpec(
                step=_STEP,
                slice_spp=1,
                max_spp=spp,
                rule=FixedSpec(spp=spp),
                variant=plan.variant,
                parameters={"width": width, "height": height},
            )
            job = client.submit(_SCENE, spec)
            done = client.wait(job.id)
            if done.state.value != "converged":
                raise AssertionError(f"the job is {done.state.value}: {done.reason}")
            _look(client, job.id)
            return peaks(farm)


def _many_made_up(plan: Plan, count: int, width: int, height: int) -> dict[str, float]:
    with tempfile.TemporaryDirectory() as folder:
        farm = ServiceFarm(Path(folder), jobs=0, threads=plan.threads)
        with farm, Client(farm.url) as client:
            cap = 100 * _SLICES
            spec = JobSpec(
                step=_STEP, slice_spp=1, max_spp=cap, rule=FixedSpec(spp=cap), variant=MADE_UP
            )
            jobs = [
                farm.jobs.create(spec, name="still", scene_sha256="0" * 64).job.id
                for _ in range(count)
            ]
            of = {"slices": _SLICES, "width": width, "height": height}
            with made_up(farm.redis_url, farm.blobs, jobs, **of):
                farm.wait(
                    lambda: all(client.job(one).points >= _SLICES // _STEP for one in jobs),
                    _PATIENCE_S,
                )
                for job_id in jobs:
                    _look(client, job_id)
                time.sleep(1.0)  # until the last checkpoint is written
            return {role: mb for role, mb in peaks(farm).items() if role in ("API", "monitor")}


def _look(client: Client, job_id: str) -> None:
    for picture in ("image.exr", "image.png", "difference.png"):
        client.image(job_id, picture)
    client.curve(job_id)


def figures(found: Found) -> list[Figure]:
    """Return the figures, with the monitor's memory for each further job."""
    made = []
    for size, farms in found.items():
        for jobs, roles in farms.items():
            for role, mb in roles.items():
                made.append(figure(f"{size}, {jobs} at once: {role}", [mb], "MB"))
        one, many = farms
        each = (farms[many]["monitor"] - farms[one]["monitor"]) / (many - one)
        made.append(figure(f"{size}: the monitor, for each further job", [each], "MB"))
    return made


def tables(report: dict[str, Any]) -> dict[str, str]:
    """Return a report as Markdown."""
    found = {one["name"]: one["value"] for one in report["figures"]}
    sizes = dict.fromkeys(name.split(",")[0] for name in found if " at once: " in name)

    def cell(size: str, jobs: int, role: str) -> str:
        mb = found.get(f"{size}, {jobs} at once: {role}")
        return "as with 1" if mb is None else f"{mb:.0f}"

    rows = []
    for size in sizes:
        heads = dict.fromkeys(
            int(name.split()[1]) for name in found if name.startswith(f"{size}, ")
        )
        rows += [[size, str(jobs), *(cell(size, jobs, role) for role in ROLES)] for jobs in heads]
    each = [[size, f"{found[f'{size}: the monitor, for each further job']:.0f}"] for size in sizes]
    return {
        "memory": markdown.table(["MB at most", "jobs at once", *ROLES], rows),
        "memory-each": markdown.table(["", "the monitor, MB for each further job"], each),
    }


if __name__ == "__main__":
    main()
