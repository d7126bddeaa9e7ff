"""What samples by zones save: `make bench-allocation`.

Jobs of each scene are replayed from recorded slices until the rule `visible` stops them: whole
frames, the farm's zones, and other ways to spread samples. What they leave visible is then counted
by the noise of the whole recording, and so is how many samples each way needs for the same truth.
"""

from __future__ import annotations

import argparse
import json
from typing import TYPE_CHECKING, Any

import numpy as np

from bench.allocating.film import JUDGING, Film
from bench.allocating.recordings import SCENES, add_options, recorded
from bench.allocating.truth import Truth
from bench.allocating.ways import Cycles, Frames, Naive, Neyman, Zones
from bench.support import markdown
from bench.support.farms.plateau_render import render
from bench.support.report import Figure, last_figures, last_report, renewed, write_report
from plateau import scenes
from plateau.farm.images.exr import decode_layers
from plateau.metric import View, Visible, VisibleDifferences
from plateau.metric.compiled import CompiledVisibleDifferences
from plateau.metric.estimate import allowed_pixels

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

    from bench.allocating.recordings import Size
    from bench.allocating.ways import Way
    from bench.experiment.cases import Case

TARGET = 0.0002
FRAMES, ORACLE = "whole frames", "oracle, {} px"
WAYS: dict[str, Callable[[], Way]] = {
    FRAMES: Frames,
    "zones, 16 px": lambda: Zones(16),
    "zones, 32 px": lambda: Zones(32),
    "zones, 64 px": lambda: Zones(64),
    "zones, 16 px, by the judging halves": lambda: Zones(16, JUDGING),
    "naive, 16 px": lambda: Naive(16),
    "Neyman, 16 px": lambda: Neyman(16),
    "Cycles, by pixels": Cycles,
}
_SPP, _EST, _TRUTH, _SAME = "spp", "estimate", "truth", "spp at the target's truth"
_NOTES = (
    "Jobs are replayed: a pixel's first samples are the same in every way to spread them.",
    "A round is always in flight: it was decided before the image that is judged.",
    "Truth is a mean over 12 samples of noise, scaled; a job has seen 10 % to 30 % of it.",
    "The oracle knows the noise of each zone from half of these, and is judged by the others.",
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    add_options(parser)
    parser.add_argument(
        "--live",
        action="store_true",
        help="render a job by zones of 16 px instead of replaying any: for scenes of which zones "
        "need more samples than can be recorded",
    )
    asked = parser.parse_args()
    kept = last_figures("allocation")
    settings = last_report("allocation")["settings"].get("scenes", {})
    for name in asked.cases:
        recording = recorded(SCENES[name], asked.pixels, asked.spp, asked.slice_spp, asked.data)
        scene = f"{name}, {asked.pixels} px"
        settings[scene] = {"spp": asked.spp, "slice_spp": asked.slice_spp, "runs": asked.runs}
        if asked.live:
            settings[scene] |= {"runs": 1, "live": True}
        truth = Truth(CompiledVisibleDifferences(View()), recording, asked.slice_spp)
        if asked.live:
            out = asked.data / f"{SCENES[name].slug}-{asked.pixels}-live"
            rows = live(SCENES[name], truth, asked.pixels, out)
        else:
            rows = measured(recording, truth, asked.slice_spp, asked.runs)
        kept = renewed(
            kept,
            scene,
            (
                Figure(name=f"{way}: {what}", value=value, unit=unit_of(what))
                for way, row in rows.items()
                for what, value in row.items()
            ),
        )
    about = {"target": TARGET, "scenes": settings}
    report = write_report("allocation", kept, settings=about, notes=_NOTES)
    markdown.fill(markdown.DOCS / "allocation.md", tables(report))


def measured(
    recording: NDArray[np.float32], truth: Truth, slice_spp: int, runs: int
) -> dict[str, dict[str, float]]:
    """Return what each way spent and left, as means over the runs; nothing if one did not end."""
    metric = truth.metric
    allowed = allowed_pixels(TARGET, recording.shape[1] * recording.shape[2])
    rows: dict[str, list[dict[str, float]]] = {}
    for run in range(runs):
        order = np.random.default_rng(run).permutation(len(recording))
        film = Film(recording, slice_spp, order)
        for name, way in WAYS.items():
            film.clear()
            estimate = ended(film, way(), metric)
            if estimate is not None:
                left = float(truth.visible(film.spp).sum())
                same = truth.spp_at(allowed, film.spp)
                row = {_SPP: film.mean_spp, _EST: estimate, _TRUTH: left, _SAME: same}
                rows.setdefault(name, []).append(row)
    found = {
        name: {what: float(np.mean([row[what] for row in some])) for what in some[0]}
        for name, some in rows.items()
        if len(some) == runs
    }
    return found | oracles(truth, allowed)


def live(case: Case, truth: Truth, size: Size, out: Path) -> dict[str, dict[str, float]]:
    """Return what a real job by zones spent and left, and what whole frames need for the same.

    The job's results are in the folder `out`; it is rendered if there is none.
    """
    if not out.exists():
        film = {"width": size.width, "height": size.height, "intensity": f"{case.intensity:g}"}
        options = {"--allocation": "zones", "--max-spp": 50_000}
        render(scenes.FOLDER / case.family, out, parameters=film, options=options)
    spp = decode_layers((out / "image.exr").read_bytes())["spp"]
    job = json.loads((out / "summary.json").read_text())
    allowed = allowed_pixels(TARGET, spp.size)
    zones = {
        _SPP: float(spp.mean()),
        _EST: job["estimate_pixels"],
        _TRUTH: float(truth.visible(spp).sum()),
        _SAME: truth.spp_at(allowed, spp),
    }
    return {
        FRAMES: {_SAME: truth.spp_at(allowed, float(spp.mean()))},
        "zones, 16 px": zones,
        **oracles(truth, allowed),
    }


def oracles(truth: Truth, allowed: float) -> dict[str, dict[str, float]]:
    """Return what zones of two sizes need if their noise is known."""
    return {ORACLE.format(size): {_SAME: truth.oracle(allowed, size)} for size in (16, 32)}


def ended(film: Film, way: Way, metric: VisibleDifferences) -> float | None:
    """Render a job to its end; return its estimate, None if the recording was too short."""
    rule = Visible(target=TARGET)
    everywhere = np.ones(film.spp.shape, np.bool_)
    film.add(everywhere, film.whole(100))
    flying = everywhere, film.whole(100)
    while True:
        seen = film.evidence(metric)
        if rule.judge(seen).stop:
            assert seen.estimate is not None
            return seen.estimate.pixels
        following = way.plan(film, seen, np.where(flying[0], flying[1], 0), TARGET)
        film.add(*flying)
        flying = following
        if film.exhausted:
            return None


def unit_of(what: str) -> str:
    return "pixels" if what in (_EST, _TRUTH) else "spp"


def tables(report: dict[str, Any]) -> dict[str, str]:
    """Return every table by the name of its place in the document."""
    values = {one["name"]: one["value"] for one in report["figures"]}
    found = list(report["settings"]["scenes"])
    ways = [*WAYS, *(ORACLE.format(size) for size in (16, 32))]

    def cell(scene: str, way: str) -> str:
        first, one = (
            [values.get(f"{scene}: {name}: {what}") for what in (_SPP, _SAME, _EST, _TRUTH)]
            for name in (FRAMES, way)
        )
        same = "–" if one[1] is None or first[1] is None else f"{first[1] / one[1]:.2f}"
        if way.startswith("oracle"):
            return f"same truth {same}"
        if one[0] is None:
            return "not ended"
        stop = "–" if first[0] is None else f"{first[0] / one[0]:.2f}"
        ratio = "–" if not one[3] else f"{one[2] / one[3]:.2f}"
        return f"{stop}, {same}, {ratio}"

    spent = markdown.table(
        ["way", *found],
        [[way, *(cell(scene, way) for scene in found)] for way in ways],
    )
    return {"allocation": spent}


if __name__ == "__main__":
    main()
