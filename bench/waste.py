"""Samples that are rendered for nothing, and how long workers wait: `make bench-waste`.

Redis and the monitor are real. The workers are simulated: they take a render's time to make noise
whose truth is known, and otherwise do what real ones do, also cancel within a slice.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from itertools import product
from typing import Any

from bench.support import markdown
from bench.support.farms.noise_workers import noise_farm, run_job
from bench.support.farms.synthetic_noise import Render
from bench.support.report import Figure, figure, write_report
from plateau.farm.model.spec import JobSpec

#: Largest share of samples that may be wasted, relative to those in the image, by workers.
GOALS = {2: 0.03, 16: 0.08}
SIZE = 96
SCENES = ("checks", "ramp")


@dataclass(frozen=True)
class Ended:
    """One job, and its cost."""

    spp: int
    wasted: float  #: samples rendered but not in the image, relative to those in it
    waited: float  #: share of the workers' time in which they had nothing to do


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--workers", type=int, nargs="+", default=list(GOALS))
    parser.add_argument("--slice-ms", type=float, default=350, help="of a slice's rendering")
    parser.add_argument("--levels", type=float, nargs="+", default=[0.3, 0.4, 0.55])
    options = parser.parse_args()

    renders = [
        Render(scene, "Gaussian", level, SIZE, seed)
        for seed, (scene, level) in enumerate(product(SCENES, options.levels))
    ]
    found = {count: measure(renders, count, options.slice_ms / 1000) for count in options.workers}
    report = write_report(
        "waste",
        [one for count, ended in found.items() for one in figures(count, ended)],
        settings={
            "workers": options.workers,
            "size": f"{SIZE}×{SIZE}",
            "jobs": len(renders),
            "slice_ms": options.slice_ms,
            "rule": JobSpec().rule.name,
            "step": JobSpec().step,
            "slice_spp": JobSpec().slice_spp,
            "spp": sorted(one.spp for one in found[options.workers[0]]),
        },
        notes=[
            "One job at a time; with others in the queue, idle workers would render those.",
            "Workers are simulated, so that sixteen fit this machine; Redis and monitor are real.",
        ],
    )
    markdown.fill(markdown.DOCS / "performance.md", tables(report))


def figures(workers: int, ended: list[Ended]) -> list[Figure]:
    """Return what the workers wasted and how long they waited, in all jobs and in each."""
    goal = GOALS.get(workers)
    final, wasted = sum(one.spp for one in ended), sum(one.spp * one.wasted for one in ended)
    return [
        figure(
            f"{workers} workers: wasted, of all jobs",
            [wasted / final],
            "of the samples",
            goal=None if goal is None else f"at most {goal:g}",
        ),
        figure(f"{workers} workers: wasted, of a job", [one.wasted for one in ended], "of them"),
        figure(
            f"{workers} workers: without work, of a job", [one.waited for one in ended], "of them"
        ),
    ]


def measure(renders: list[Render], workers: int, slice_s: float) -> list[Ended]:
    """Have simulated workers render one job after the other."""
    ended = []
    with noise_farm(workers, slice_s / JobSpec().slice_spp) as (jobs, crew):
        for render in renders:
            crew.render = render
            one, spent = run_job(jobs, crew.spent, JobSpec()), crew.spent
            wasted = spent.spp / one.job.spp - 1
            waited = 1 - spent.busy_s / (workers * one.seconds)
            ended.append(Ended(one.job.spp, wasted, waited))
            print(f"{workers} workers, {render}: {ended[-1]}", file=sys.stderr)
    return ended


def tables(report: dict[str, Any]) -> dict[str, str]:
    """Return a report as Markdown: what is wasted and how long workers wait."""
    found = {one["name"]: one for one in report["figures"]}

    def row(workers: int) -> list[str]:
        of_all, of_one, waited = (
            found[f"{workers} workers: {what}"]
            for what in ("wasted, of all jobs", "wasted, of a job", "without work, of a job")
        )
        return [
            str(workers),
            f"{of_all['value']:.1%}",
            f"{of_one['spread']['lowest']:.1%} to {of_one['spread']['highest']:.1%}",
            f"{waited['value']:.1%}",
        ]

    head = ["workers", "wasted, of all samples", "of one job's", "workers' time without work"]
    return {"waste": markdown.table(head, [row(one) for one in report["settings"]["workers"]])}


if __name__ == "__main__":
    main()
