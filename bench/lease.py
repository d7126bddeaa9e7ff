"""From the lease to the first sample, in a scene that is loaded and in one that is not.

`make bench-lease` starts `plateau up` with one warm worker and takes the scenes of scenes/ in
turns, two jobs of each. The worker has to load the scene for the first of them, and has it loaded
for the second. A slice has one sample per pixel here. The time is that from the job's first lease
to the commit of its first slice, by Redis's clock, so it includes one upload.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bench.support import markdown
from bench.support.cores import others_meanwhile
from bench.support.farms.service_farm import ServiceFarm
from bench.support.report import OTHERS, Figure, figure, others_figure, write_report
from plateau.client import Client
from plateau.farm.model.spec import FixedSpec, JobSpec, Variant
from plateau.scenes import FOLDER

_SPP = 4  #: of a job
JOBS = ("first job of a scene", "second job of a scene")


@dataclass(frozen=True, kw_only=True)
class Plan:
    """What is submitted, after a round that does not count."""

    scenes: tuple[str, ...] = ("box", "bar", "oculist", "plants")
    size: int = 256  #: of the image, in pixels
    rounds: int = 5
    threads: int = field(default_factory=lambda: len(os.sched_getaffinity(0)))
    variant: Variant = "auto"


@dataclass(frozen=True)
class Found:
    """Seconds by scene, one list for each of `JOBS`; and what else was on the cores, by round."""

    seconds: dict[str, tuple[list[float], list[float]]]
    others: list[float]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=Plan.rounds, help="over all scenes")
    parser.add_argument("--size", type=int, default=Plan.size, help="of the image, in pixels")
    options = parser.parse_args()
    plan = Plan(rounds=options.rounds, size=options.size)
    report = write_report(
        "lease",
        figures(measure(plan)),
        settings={
            "size": f"{plan.size}×{plan.size}",
            "rounds": plan.rounds,
            "workers": 1,
            "threads": plan.threads,
        },
        notes=[
            "One job at a time. A first round is not counted: it unpacks scenes, compiles kernels.",
            "Where other work had a share of the cores, times are too long.",
        ],
    )
    markdown.fill(markdown.DOCS / "performance.md", tables(report))


def measure(plan: Plan) -> Found:
    """Return what leases take in each scene."""
    found = Found({scene: ([], []) for scene in plan.scenes}, [])
    with tempfile.TemporaryDirectory() as folder:
        farm = ServiceFarm(Path(folder), jobs=0, threads=plan.threads)
        with farm, Client(farm.url) as client:
            for number in range(plan.rounds + 1):
                with others_meanwhile() as others:
                    took = {one: _pair(farm, client, plan, one, number) for one in plan.scenes}
                if number == 0:
                    continue
                for scene, seconds in took.items():
                    for all_, one_s in zip(found.seconds[scene], seconds, strict=True):
                        all_.append(one_s)
                found.others.append(others.share)
                print(f"round {number} of {plan.rounds}: {took}", file=sys.stderr)
    return found


def _pair(
    farm: ServiceFarm, client: Client, plan: Plan, scene: str, number: int
) -> tuple[float, float]:
    """Render two jobs of a scene, one after the other; return the seconds of each."""
    first_s, second_s = (
        _seconds(
            farm,
            client,
            FOLDER / scene,
            JobSpec(
                step=_SPP,
                slice_spp=1,
                max_spp=_SPP,
                rule=FixedSpec(spp=_SPP),
                seed=2 * number + second,
                variant=plan.variant,
                parameters={"width": plan.size, "height": plan.size},
            ),
        )
        for second in (0, 1)
    )
    return first_s, second_s


def _seconds(farm: ServiceFarm, client: Client, scene: Path, spec: JobSpec) -> float:
    """Render a job; return the seconds from its first lease to its first commit."""
    done = client.wait(client.submit(scene, spec).id)
    if done.started_at is None:
        raise AssertionError(f"a job is {done.state.value}: {done.reason}")
    committed_ms: float = min(record["at"] for record in farm.jobs.ledger(done.id).values())
    return committed_ms / 1000 - done.started_at.timestamp()


def figures(found: Found) -> list[Figure]:
    """Return what was found."""
    made = [
        figure(f"{scene}: {job}", seconds, "s")
        for scene, both in found.seconds.items()
        for job, seconds in zip(JOBS, both, strict=True)
    ]
    return [*made, others_figure(found.others)]


def tables(report: dict[str, Any]) -> dict[str, str]:
    """Return a report as Markdown: the times of each scene, and the machine."""
    found = {one["name"]: one for one in report["figures"]}
    scenes = dict.fromkeys(name.partition(":")[0] for name in found if name != OTHERS)

    def cell(name: str) -> str:
        return markdown.spread(found[name], 3)

    rows = [[scene, *(cell(f"{scene}: {job}") for job in JOBS)] for scene in scenes]
    return {
        "lease": markdown.table(["lease to first sample, s", *JOBS], rows),
        "lease-machine": markdown.machine(report, ("size", "rounds", "workers", "threads")),
    }


if __name__ == "__main__":
    main()
