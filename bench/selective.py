"""The paper's rules by zone, its "selective rendering": `make bench-selective`.

Each zone of a recorded scene is an image of its own. A rule judges it every 100 spp, and ends its
samples. What the whole image leaves visible is then counted by the noise of the whole recording,
and so is how many samples whole frames need for the same.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

import numpy as np

from bench.allocating.film import Film, spread
from bench.allocating.recordings import SCENES, add_options, recorded
from bench.allocating.truth import Truth
from bench.allocating.ways import Frames, Zones
from bench.allocation import ended
from bench.support import markdown
from bench.support.report import Figure, last_figures, last_report, write_report
from plateau.metric import Evidence, View, create_rule
from plateau.metric.compiled import CompiledVisibleDifferences

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from bench.allocating.ways import Way

STEP = 100
RULES = ("successive", "multiple", "reverse", "myszkowski")
#: Sides of the zones in pixels; None for the whole frame.
SIZES = (None, 64, 32)
VISIBLE: dict[str, Callable[[], Way]] = {"whole frames": Frames, "16 px": lambda: Zones(16)}
_SPP, _WRONG, _FRAMES, _OPEN = "spp", "visibly wrong", "whole frames for the same", "not ended"
_UNITS = {_SPP: "spp", _WRONG: "of the pixels", _FRAMES: "spp", _OPEN: "of the zones"}
_NOTES = (
    "Each zone is judged as an image of its own, with as many pixels per degree as the whole.",
    "A zone whose rule has not ended has all samples that were recorded.",
    "Truth is a mean over 12 samples of noise. Less than a pixel of it is compared with nothing.",
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    add_options(parser)
    asked = parser.parse_args()
    kept = last_figures("selective")
    settings = last_report("selective")["settings"].get("scenes", {})
    for name in asked.cases:
        recording = recorded(SCENES[name], asked.pixels, asked.spp, asked.slice_spp, asked.data)
        scene = f"{name}, {asked.pixels} px"
        settings[scene] = {"spp": asked.spp, "slice_spp": asked.slice_spp, "runs": asked.runs}
        kept = [one for one in kept if not one.name.startswith(f"{scene}: ")]
        for way, row in measured(recording, asked.slice_spp, asked.runs).items():
            kept += [
                Figure(name=f"{scene}: {way}: {what}", value=value, unit=_UNITS[what])
                for what, value in row.items()
            ]
    report = write_report(
        "selective", kept, settings={"step": STEP, "scenes": settings}, notes=_NOTES
    )
    markdown.fill(markdown.DOCS / "paper.md", tables(report))


def measured(
    recording: NDArray[np.float32], slice_spp: int, runs: int
) -> dict[str, dict[str, float]]:
    """Return what each way spent and left, as means over the runs."""
    metric = CompiledVisibleDifferences(View())
    truth = Truth(metric, recording, slice_spp)
    rows: dict[str, list[dict[str, float]]] = {}

    def note(way: str, spp: NDArray[Any], still: float = 0.0) -> None:
        left = float(truth.visible(spp).sum())
        row = {_SPP: float(spp.mean()), _WRONG: left / spp.size, _OPEN: still}
        if left >= 1:  # else there is nothing to compare
            row[_FRAMES] = truth.spp_at(left, float(spp.mean()))
        rows.setdefault(way, []).append(row)

    for run in range(runs):
        order = np.random.default_rng(run).permutation(len(recording))
        for name in RULES:
            for size in SIZES:
                note(way_of(name, size), *by_zone(recording[order], slice_spp, name, size))
        film = Film(recording, slice_spp, order)
        for size_name, way in VISIBLE.items():
            film.clear()
            ended(film, way(), metric)
            note(f"visible, {size_name}", film.spp, float(film.exhausted))
    return {
        way: {
            what: float(np.mean([row[what] for row in some]))
            for what in _UNITS
            if all(what in row for row in some)
        }
        for way, some in rows.items()
    }


def way_of(rule: str, size: int | None) -> str:
    """Return the name of a rule by zones of this size."""
    return f"{rule}, whole frames" if size is None else f"{rule}, {size} px"


def by_zone(
    slices: NDArray[np.float32], slice_spp: int, name: str, size: int | None
) -> tuple[NDArray[np.int64], float]:
    """Return the samples of each pixel when the rule has ended its zone, and the zones it has not.

    The latter are a share of all zones.
    """
    each = STEP // slice_spp
    steps = len(slices) // each
    side = size or slices.shape[1]
    found = np.full((-(-slices.shape[1] // side), -(-slices.shape[2] // side)), steps * STEP)
    still = 0
    for row, column in np.ndindex(found.shape):
        zone = slices[:, row * side : (row + 1) * side, column * side : (column + 1) * side]
        metric = CompiledVisibleDifferences(_seen_alike(slices.shape[2]))
        rule, total = create_rule(name), np.zeros(zone.shape[1:])
        for step in range(1, steps + 1):
            total += zone[(step - 1) * each : step * each].sum(axis=0, dtype=np.float64)
            image = (total / (step * each)).astype(np.float32)
            if rule.judge(Evidence(step * STEP, image, None, metric)).stop:
                found[row, column] = step * STEP
                break
        else:
            still += 1
    return spread(found, side, slices[0]), still / found.size


def _seen_alike(whole: int) -> View:
    """Return the view of a zone: its pixels look as large as those of the whole image."""
    return View(pixels_per_degree=whole / View().width_deg(whole))


def tables(report: dict[str, Any]) -> dict[str, str]:
    """Return the table by the name of its place in the document."""
    values = {one["name"]: one["value"] for one in report["figures"]}
    scenes = list(report["settings"]["scenes"])
    ways = [way_of(name, size) for name in RULES for size in SIZES]
    ways += [f"visible, {name}" for name in VISIBLE]

    def cell(scene: str, way: str) -> str:
        spp, wrong, still = (values[f"{scene}: {way}: {what}"] for what in (_SPP, _WRONG, _OPEN))
        frames = values.get(f"{scene}: {way}: {_FRAMES}")
        same = "–" if frames is None else f"{frames / spp:.2f}"
        return f"{'over ' if still else ''}{spp:,.0f}, {wrong:.2%}, {same}"

    return {
        "selective": markdown.table(
            ["rule", *scenes], [[way, *(cell(scene, way) for scene in scenes)] for way in ways]
        )
    }


if __name__ == "__main__":
    main()
