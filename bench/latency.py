"""How soon results are visible in a farm at work: `make bench-latency`.

`plateau up` runs with all its parts and one warm worker, which renders on every core. One job after
the other is submitted over HTTP, and watched to its end and beyond:

- submit to first preview: from before the POST until `GET …/image.png` answers with an image;
- commit to point: from the commit that completes a step until the point of the curve is in Redis;
- verdict to idle: from the end of the job until its render child is idle, by its CPU time. The
  small jobs end by the default rule, whose stopping point is not known in advance; the large ones
  are cancelled after their first point.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections import defaultdict
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import httpx

from bench import STILL
from bench.support import markdown
from bench.support.cores import others_meanwhile
from bench.support.farms.service_farm import ServiceFarm
from bench.support.idle import RenderChildren
from bench.support.report import Figure, figure, others_figure, p99, write_report
from plateau.client import Client, PointEvent
from plateau.farm.model.spec import JobSpec, Variant
from plateau.farm.model.states import JobState
from plateau.scenes import FOLDER

if TYPE_CHECKING:
    from collections.abc import Mapping

_SCENES = {"still": STILL, "box": FOLDER / "box"}
_POLL_S = 0.02
PREVIEW, POINT, IDLE = "submit to first preview", "commit to point", "verdict to idle worker"
_GOALS = {PREVIEW: "under 5 s", POINT: "under 0.5 s", IDLE: "under 1 s"}


@dataclass(frozen=True, kw_only=True)
class Kind:
    """Jobs of one kind."""

    scene: str
    size: int  #: of the image, in pixels
    jobs: int
    cancelled: bool = False  #: after their first point; the others end by the default rule

    @property
    def name(self) -> str:
        """Their name in the report."""
        return f"{self.scene} {self.size}×{self.size}"


@dataclass(frozen=True, kw_only=True)
class Plan:
    """The jobs that are submitted, after one of each kind that is not counted."""

    kinds: tuple[Kind, ...] = (
        Kind(scene="still", size=128, jobs=100),
        Kind(scene="box", size=512, jobs=8, cancelled=True),
    )
    threads: int = field(default_factory=lambda: len(os.sched_getaffinity(0)))
    variant: Variant = "auto"


@dataclass(frozen=True)
class Found:
    """Seconds by kind of job and by measure; and other work's share of the cores."""

    seconds: dict[str, dict[str, list[float]]]
    others: list[float]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--small", type=int, default=100, help="small jobs")
    parser.add_argument("--large", type=int, default=8, help="jobs of 512×512 pixels")
    options = parser.parse_args()
    small, large = Plan().kinds
    plan = Plan(kinds=(replace(small, jobs=options.small), replace(large, jobs=options.large)))
    report = write_report(
        "latency",
        figures(measure(plan)),
        settings={
            "kinds": {one.name: one.jobs for one in plan.kinds},
            "workers": 1,
            "threads": plan.threads,
        },
        notes=[
            "One job at a time; a first job of each kind is not counted.",
            "Points and ends are timed by Redis's clock, which is this machine's.",
            "The time to idle is exact to the hundredths of a second of the kernel's CPU times.",
            "If other work had a share of the cores, times are too long.",
        ],
    )
    markdown.fill(markdown.DOCS / "performance.md", tables(report))


def measure(plan: Plan) -> Found:
    """Submit the jobs and return their times."""
    found = Found({one.name: defaultdict(list) for one in plan.kinds}, [])
    with tempfile.TemporaryDirectory() as folder:
        farm = ServiceFarm(Path(folder), jobs=0, threads=plan.threads)
        with farm, Client(farm.url) as client, RenderChildren(farm.pid) as children:
            for kind in plan.kinds:
                stored = _take(farm, client, children, plan, kind, 0, defaultdict(list))
                with others_meanwhile() as others:
                    for number in range(1, kind.jobs + 1):
                        into = found.seconds[kind.name]
                        _take(farm, client, children, plan, kind, number, into, stored)
                found.others.append(others.share)
                print(f"{kind.jobs} jobs of {kind.name} done", file=sys.stderr)
    return found


def _take(
    farm: ServiceFarm,
    client: Client,
    children: RenderChildren,
    plan: Plan,
    kind: Kind,
    seed: int,
    into: Mapping[str, list[float]],
    stored: str | None = None,
) -> str:
    """Submit one job, wait for its end, and note its times; return its scene's SHA-256."""
    spec = JobSpec(
        seed=seed,
        variant=plan.variant,
        parameters={"width": kind.size, "height": kind.size},
    )
    submitted = time.time()
    job = client.submit(stored or _SCENES[kind.scene], spec)
    with httpx.Client(trust_env=False) as http:
        while http.get(f"{farm.url}/v1/jobs/{job.id}/image.png").status_code != httpx.codes.OK:
            time.sleep(_POLL_S)
    preview_s = time.time() - submitted
    if kind.cancelled:
        farm.wait(lambda: client.job(job.id).points > 0)
        client.cancel(job.id)
    done = client.wait(job.id)
    expected = JobState.CANCELLED if kind.cancelled else JobState.CONVERGED
    if done.state is not expected or done.ended_at is None:
        raise AssertionError(f"a job is {done.state.value}, not {expected.value}: {done.reason}")
    into[IDLE].append(max(0.0, children.idle_since() - done.ended_at.timestamp()))
    into[PREVIEW].append(preview_s)
    committed = [record["at"] / 1000 for record in farm.jobs.ledger(job.id).values()]
    for event in client.happened(job.id):
        if isinstance(event, PointEvent):
            slices = event.point.spp // spec.slice_spp
            into[POINT].append(event.at.timestamp() - max(committed[:slices]))
    return done.scene_sha256


def figures(found: Found) -> list[Figure]:
    """Return the figures: for each kind and measure all values, and their 99th percentile."""
    made = []
    for kind, measures in found.seconds.items():
        for name, seconds in measures.items():
            made.append(figure(f"{kind}: {name}", seconds, "s"))
            made.append(figure(f"{kind}: {name}: p99", [p99(seconds)], "s", goal=_GOALS[name]))
    return [*made, others_figure(found.others)]


def tables(report: dict[str, Any]) -> dict[str, str]:
    """Return a report as Markdown: the latencies, and the machine."""
    found = {one["name"]: one for one in report["figures"]}
    kinds: dict[str, int] = report["settings"]["kinds"]

    def cell(kind: str, name: str) -> str:
        all_, p99 = found[f"{kind}: {name}"], found[f"{kind}: {name}: p99"]
        values = (all_["value"], p99["value"], all_["spread"]["highest"])
        return " / ".join(f"{value:.2f}" for value in values)

    rows = [[name, *(cell(kind, name) for kind in kinds), goal] for name, goal in _GOALS.items()]
    heads = [f"{kind}, {jobs} jobs" for kind, jobs in kinds.items()]
    return {
        "latency": markdown.table(["median / p99 / slowest, s", *heads, "goal"], rows),
        "latency-machine": markdown.machine(report, ("workers", "threads")),
    }


if __name__ == "__main__":
    main()
