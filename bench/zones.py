"""Wall time of jobs by frame and by zones, with few workers and with many: `make bench-zones`.

Redis and the monitor are real. The workers are simulated: they take a render's time to make noise
whose truth is known.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from bench.support import markdown
from bench.support.farms.noise_workers import noise_farm, run_job
from bench.support.farms.synthetic_noise import Render
from bench.support.report import Figure, figure, write_report
from plateau.farm.model.spec import JobSpec

if TYPE_CHECKING:
    from collections.abc import Sequence

#: Workers, and milliseconds of a slice by frame. Two cores hardly simulate sixteen fast workers.
CASES = ((1, 150), (4, 150), (16, 150), (16, 600))
SIZE, ZONE = 96, 16
FRAME, ZONES = {"name": "frame"}, {"name": "zones", "size": ZONE}


@dataclass(frozen=True)
class Pair:
    """A render by frame and by zones: zones over frame."""

    spp: float
    seconds: float
    wasted: float  #: by zones: samples rendered but not in the image, relative to those in it


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--levels", type=float, nargs="+", default=[0.4, 0.55])
    options = parser.parse_args()

    renders = [Render("ramp", "Gaussian", level, SIZE, 1) for level in options.levels]
    found = {case: measure(renders, *case) for case in CASES}
    report = write_report(
        "zones",
        [one for case, pairs in found.items() for one in figures(*case, pairs)],
        settings={
            "cases": CASES,
            "size": f"{SIZE}×{SIZE}",
            "zone": ZONE,
            "jobs": len(renders),
            "rule": JobSpec().rule.name,
            "step": JobSpec().step,
        },
        notes=[
            "Workers are simulated, so that sixteen fit this machine; Redis and monitor are real."
        ],
    )
    markdown.fill(markdown.DOCS / "performance.md", tables(report))


def measure(renders: Sequence[Render], workers: int, slice_ms: float) -> list[Pair]:
    """Have simulated workers render one job after the other, by frame and by zones.

    `slice_ms` is the time of a slice by frame.
    """
    frame_spec = JobSpec.model_validate({"allocation": FRAME})
    zones_spec = JobSpec.model_validate({"allocation": ZONES})
    pairs = []
    with noise_farm(workers, slice_ms / 1000 / frame_spec.slice_spp) as (jobs, crew):
        for crew.render in renders:
            frame = run_job(jobs, crew.spent, frame_spec)
            zones = run_job(jobs, crew.spent, zones_spec)
            pairs.append(
                Pair(
                    spp=zones.job.spp / frame.job.spp,
                    seconds=zones.seconds / frame.seconds,
                    wasted=max(0.0, crew.spent.spp / zones.job.spp - 1),
                )
            )
            print(f"{_case(workers, slice_ms)}, {crew.render}: {pairs[-1]}", file=sys.stderr)
    return pairs


def figures(workers: int, slice_ms: float, pairs: Sequence[Pair]) -> list[Figure]:
    """Return what zones take of the samples and of the time, and what they waste."""
    case = _case(workers, slice_ms)
    return [
        figure(f"{case}: samples", [one.spp for one in pairs], "of those by frame"),
        figure(
            f"{case}: wall time",
            [one.seconds for one in pairs],
            "of that by frame",
            goal="at most 1",
        ),
        figure(f"{case}: wasted", [one.wasted for one in pairs], "of the samples"),
    ]


def _case(workers: int, slice_ms: float) -> str:
    return f"{workers} workers, slices of {slice_ms} ms"


def tables(report: dict[str, Any]) -> dict[str, str]:
    """Return a report as Markdown."""
    found = {one["name"]: one for one in report["figures"]}

    def row(workers: int, slice_ms: float) -> list[str]:
        samples, seconds, wasted = (
            found[f"{_case(workers, slice_ms)}: {what}"]
            for what in ("samples", "wall time", "wasted")
        )
        return [
            str(workers),
            f"{slice_ms} ms",
            markdown.spread(samples, 2),
            markdown.spread(seconds, 2),
            f"{wasted['value']:.1%}",
        ]

    head = [
        "workers",
        "a slice by frame takes",
        "samples, of those by frame",
        "wall time, of that by frame",
        "wasted",
    ]
    return {"zones": markdown.table(head, [row(*one) for one in report["settings"]["cases"]])}


if __name__ == "__main__":
    main()
