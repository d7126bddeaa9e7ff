"""What denoising saves, and whether its error is known: `make bench-denoising`.

Images of more and more samples are put together from recorded slices: as they are, denoised, and as
the farm delivers them, blended. The rest of the recording says how many pixels are visibly wrong.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from bench import ROOT
from bench.allocating.denoised_frames import Point, by_peers, ended, points, spp_at
from bench.allocating.denoised_zones import looks
from bench.allocating.denoising_tables import (
    BLEND,
    DENOISED,
    KINDS,
    OWN,
    RAW,
    RULES,
    TARGETS,
    best_of,
    peers_of,
    tables,
    zones_of,
)
from bench.allocating.peers import PEERS
from bench.allocating.recordings import HARD, SCENES, add_options, recorded
from bench.allocating.true_risk import shares
from bench.support import markdown
from bench.support.report import Figure, figure, last_figures, last_report, renewed, write_report
from plateau.metric import View, Visible
from plateau.metric.compiled import CompiledVisibleDifferences
from plateau.service.monitor.denoising import oidn

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from bench.allocating.recordings import Size
    from bench.experiment.cases import Case

#: Shares of the pixels from which on an estimate is compared with the truth.
ENOUGH = 0.001
_NOTES = (
    "Images are put together from recorded slices; the rest of the recording is the reference.",
    "What the reference's own noise makes visible is estimated, and taken from what is counted.",
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    every = SCENES | HARD
    add_options(parser, choices=every)
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=list(PARTS))
    asked = parser.parse_args()
    kept = last_figures("denoising")
    settings = last_report("denoising")["settings"].get("scenes", {})
    for name in asked.cases:
        case = every[name]
        recording = recorded(case, asked.pixels, asked.spp, asked.slice_spp, asked.data)
        guides = guides_of(case, asked.pixels, asked.data)
        scene = f"{name}, {asked.pixels} px"
        for part in asked.parts:
            name_of, measure = PARTS[part]
            found = measure(recording, asked.slice_spp, guides, asked.runs)
            kept = renewed(kept, name_of(scene), found)
            settings[name_of(scene)] = {
                "spp": asked.spp,
                "slice_spp": asked.slice_spp,
                "runs": asked.runs,
            }
    report = write_report("denoising", kept, settings={"scenes": settings}, notes=_NOTES)
    markdown.fill(markdown.DOCS / "denoising.md", tables(report))


def guides_of(case: Case, size: Size, data: Path) -> NDArray[np.float32]:
    """Return albedo and normals of a scene, (2, H, W, 3)."""
    file = data / f"{case.slug}-{size}.guides.npy"
    if not file.exists():
        command = [case.family, *map(str, (*size, file))]
        module = [sys.executable, "-m", "bench.allocating.guides"]
        subprocess.run([*module, *command], check=True, cwd=ROOT)
    found: NDArray[np.float32] = np.load(file)
    return found


def figures(
    recording: NDArray[np.float32], slice_spp: int, guides: NDArray[np.float32], runs: int
) -> list[Figure]:
    """Return what the runs found of a scene."""
    rows = [points(recording, slice_spp, guides, order) for order in orders(recording, runs)]
    found = [one for kind in KINDS for one in needed(rows, kind, f"{kind}: ")]
    for kind, name in ((RAW, OWN), *product((BLEND, DENOISED), RULES)):
        if (kind, name) == (DENOISED, OWN):  # whose error is not estimated
            continue
        ends = [ended(row, kind, name) for row in rows]
        stopped = [point for point in ends if point is not None]
        if len(stopped) == runs:
            found.append(figure(f"{kind}: {name}: spp", [one.spp for one in stopped], "spp"))
            wrong = [one.wrong[kind] for one in stopped]
            found.append(figure(f"{kind}: {name}: wrong", wrong, "of the pixels"))
    for kind in (RAW, BLEND):
        ratios = [
            point.estimate(kind) / point.wrong[kind]
            for row in rows
            for point in row
            if point.wrong[kind] >= ENOUGH
        ]
        if ratios:
            found.append(figure(f"{kind}: estimate / truth", ratios, "ratio"))
    same = [point for row in rows for point in row]
    for kind in (DENOISED, BLEND):
        ratio = [p.wrong[kind] / p.wrong[RAW] for p in same if p.wrong[RAW] >= ENOUGH]
        found.append(figure(f"{kind}: wrong, of raw", ratio, "ratio"))
    told = {"points": len(same), "determined": sum(one.is_determined for one in same)}
    told["determined, and twice as wrong"] = sum(
        one.is_determined and one.wrong[BLEND] > 2 * max(one.estimate(BLEND), Visible().target)
        for one in same
    )
    found += [figure(f"{BLEND}: {name}", [count], "points") for name, count in told.items()]
    found.append(figure("a look", [point.seconds for point in same], "s"))
    found.append(figure("a look: cores", [point.core_seconds for point in same], "core s"))
    return found


def figures_of_peers(
    recording: NDArray[np.float32], slice_spp: int, guides: NDArray[np.float32], runs: int
) -> list[Figure]:
    """Return what other renderers deliver that stop in all runs, denoised."""
    rows = [by_peers(recording, slice_spp, guides, order) for order in orders(recording, runs)]
    found = []
    for peer in PEERS:
        if all(peer in row for row in rows):
            found.append(figure(f"{peer}: spp", [row[peer][0] for row in rows], "spp"))
            wrong = [row[peer][1] for row in rows]
            found.append(figure(f"{peer}: wrong", wrong, "of the pixels"))
    return found


def figures_by_zones(
    recording: NDArray[np.float32], slice_spp: int, guides: NDArray[np.float32], runs: int
) -> list[Figure]:
    """Return what the runs found where samples go by zones to where the blend is wrong."""
    metric = CompiledVisibleDifferences(View())
    denoise, _ = oidn.denoiser(tuple(guides), metric.view)
    rows = [
        [
            Point(spp=one.spp, wrong={BLEND: one.wrong}, seen={BLEND: one.seen}, is_look=True)
            for one in looks(recording, slice_spp, order, denoise, metric)
        ]
        for order in orders(recording, runs)
    ]
    found = needed(rows, BLEND)
    ends = [end for row in rows if (end := ended(row, BLEND, OWN)) is not None]
    if len(ends) == runs:
        found.append(figure(f"{OWN}: spp", [one.spp for one in ends], "spp"))
        found.append(figure(f"{OWN}: wrong", [one.wrong[BLEND] for one in ends], "of the pixels"))
        found.append(figure("looks", [len(row) for row in rows], "looks"))
    every = [one for row in rows for one in row]
    ratios = [one.estimate(BLEND) / one.wrong[BLEND] for one in every if one.wrong[BLEND] >= ENOUGH]
    return [*found, figure("estimate / truth", ratios, "ratio")] if ratios else found


def figures_at_best(
    recording: NDArray[np.float32], slice_spp: int, guides: NDArray[np.float32], runs: int
) -> list[Figure]:
    """Return what a blend would need whose risks are known in truth."""
    metric = CompiledVisibleDifferences(View())
    denoise, _ = oidn.denoiser(tuple(guides), metric.view)
    rows = [
        [
            Point(spp=one.spp, wrong={RAW: one.raw, BLEND: one.blend}, seen={})
            for one in shares(recording, slice_spp, order, denoise, metric)
        ]
        for order in orders(recording, runs)
    ]
    return [one for kind in (RAW, BLEND) for one in needed(rows, kind, f"{kind}: ")]


def orders(recording: NDArray[np.float32], runs: int) -> list[NDArray[np.intp]]:
    """Return the order in which each run has the slices."""
    return [np.random.default_rng(run).permutation(len(recording)) for run in range(runs)]


def needed(rows: Sequence[Sequence[Point]], kind: str, before: str = "") -> list[Figure]:
    """Return the samples that each target takes, if all runs come to it; `before` is its name's."""
    found = []
    for target in TARGETS:
        spp = [one for row in rows if (one := spp_at(row, kind, target)) is not None]
        if len(spp) == len(rows):
            found.append(figure(f"{before}spp at {target:.2%}", spp, "spp"))
    return found


#: What is measured of a scene: the name that its figures have, and how they are made.
PARTS: Final[dict[str, tuple[Callable[[str], str], Callable[..., list[Figure]]]]] = {
    "frames": (str, figures),
    "zones": (zones_of, figures_by_zones),
    "peers": (peers_of, figures_of_peers),
    "best": (best_of, figures_at_best),
}

if __name__ == "__main__":
    main()
