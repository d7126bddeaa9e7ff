"""What denoising takes of a job's CPU time: `make bench-denoising_costs`.

`plateau render` renders a denoised job, and then one that is delivered as it is, to as many
samples. All their processes count, from the command line to the results.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from bench.support import markdown
from bench.support.cores import Taken, timed
from bench.support.farms import plateau_render
from bench.support.report import Figure, figure, others_figure, write_report
from plateau.scenes import FOLDER

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

_RAW: Final = {"--denoise": "none", "--rule": "visible:target=1e-9"}
_DENOISED: Final = {"--denoise": "oidn"}


@dataclass(frozen=True)
class Case:
    """What is rendered: a scene, the image's width and height in pixels, and the cap."""

    scene: str
    size: int
    max_spp: int

    def __str__(self) -> str:
        return f"scenes:{self.scene}, {self.size} px"


NAMES: Final = ("spp", "looks", "as it is", "denoised", "more")
CASES: Final = (
    Case("box", 256, 800),
    Case("oculist", 256, 600),
    Case("plants", 256, 400),
    Case("box", 512, 400),
)


@dataclass(frozen=True)
class Pair:
    """Two jobs of as many samples, and the looks of the one that was denoised."""

    spp: int
    looks: int
    raw: Taken
    denoised: Taken


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pairs", type=int, default=3, help="of each scene (3)")
    asked = parser.parse_args()
    found = {case: [pair(case) for _ in range(asked.pairs)] for case in CASES}
    report = write_report(
        "denoising_costs",
        figures(found),
        settings={"pairs": asked.pairs},
        notes=["The first job ends at its target or its cap, the other at as many samples."],
    )
    markdown.fill(markdown.DOCS / "denoising.md", tables(report))


def pair(case: Case) -> Pair:
    """Render both jobs, one after the other."""
    denoised, job = _job(case, {**_DENOISED, "--max-spp": case.max_spp})
    raw, other = _job(case, {**_RAW, "--max-spp": job["spp"]})
    if other["spp"] != job["spp"]:
        raise AssertionError(f"{other['spp']} spp, not {job['spp']}")
    print(f"{case}: {denoised.cpu_s / raw.cpu_s - 1:.1%} more", file=sys.stderr)
    return Pair(job["spp"], job["points"], raw, denoised)


def _job(case: Case, options: dict[str, object]) -> tuple[Taken, dict[str, Any]]:
    """Return what a job has taken, and its summary."""
    with tempfile.TemporaryDirectory() as folder:
        with timed() as taken:
            plateau_render.render(
                FOLDER / case.scene,
                Path(folder),
                parameters={"width": case.size, "height": case.size},
                options=options,
            )
        summary: dict[str, Any] = json.loads((Path(folder) / "summary.json").read_text())
    return taken, summary


def figures(found: Mapping[Case, Sequence[Pair]]) -> list[Figure]:
    """Return the figures."""
    made = []
    for case, pairs in found.items():
        made += [
            figure(f"{case}: spp", [one.spp for one in pairs], "spp"),
            figure(f"{case}: looks", [one.looks for one in pairs], "looks"),
            figure(f"{case}: as it is", [one.raw.cpu_s for one in pairs], "core s"),
            figure(f"{case}: denoised", [one.denoised.cpu_s for one in pairs], "core s"),
            figure(
                f"{case}: more",
                [100 * (one.denoised.cpu_s / one.raw.cpu_s - 1) for one in pairs],
                "%",
                compared_with="the job as it is",
                goal="at most 10",
            ),
        ]
    every = [
        taken for pairs in found.values() for one in pairs for taken in (one.raw, one.denoised)
    ]
    return [*made, others_figure([one.others for one in every])]


def tables(report: dict[str, Any]) -> dict[str, str]:
    """Return the table by the name of its place in the document."""
    found = {one["name"]: one for one in report["figures"]}
    rows = []
    for case in CASES:
        spp, looks, *cores = (found[f"{case}: {name}"] for name in NAMES)
        row = [f"`scenes:{case.scene}`, {case.size} px", f"{spp['value']:g}, {looks['value']:g}"]
        rows.append([*row, *(markdown.spread(one, 1) for one in cores)])
    titles = ["scene", "spp, looks", "core seconds, as it is", "denoised", "more, in %"]
    return {"denoising-costs": markdown.table(titles, rows)}


if __name__ == "__main__":
    main()
