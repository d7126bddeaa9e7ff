"""What denoising saves, and whether its error is known: `make bench-denoising`.

Images of more and more samples are put together from recorded slices: as they are, denoised, and as
the farm delivers them, blended. The rest of the recording says how many pixels are visibly wrong.
"""

from __future__ import annotations

import argparse
import math
import subprocess
import sys
import time
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from bench import ROOT
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
from bench.allocating.peers import PEERS, delivered
from bench.allocating.recordings import HARD, SCENES, add_options, recorded
from bench.allocating.true_risk import shares
from bench.allocating.truth import wrong_share
from bench.support import markdown
from bench.support.report import Figure, figure, last_figures, last_report, renewed, write_report
from plateau.farm.model.slices.plan import Plan
from plateau.farm.model.spec import JobSpec
from plateau.metric import Evidence, Half, View, Visible, allowed_pixels, blended, create_rule
from plateau.metric.compiled import CompiledVisibleDifferences
from plateau.service.monitor.denoising import oidn

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from bench.allocating.recordings import Size
    from bench.experiment.cases import Case
    from plateau.metric import Image

#: Shares of the pixels from which on an estimate is compared with the truth.
ENOUGH = 0.001
_NOTES = (
    "Images are put together from recorded slices; the rest of the recording is the reference.",
    "What the reference's own noise makes visible is estimated, and taken from what is counted.",
)


@dataclass(frozen=True, kw_only=True)
class Point:
    """An image of so many samples: the shares of its pixels that are visibly wrong."""

    spp: float
    wrong: dict[str, float]  #: of each kind, counted
    seen: dict[str, Evidence]
    seconds: float = 0.0  #: of the look, and of its cores
    core_seconds: float = 0.0
    is_look: bool = False  #: whether a denoised job judges it

    @property
    def is_determined(self) -> bool:
        """Whether the samples tell how wrong the denoiser is, for Plateau's own rule."""
        found = self.seen[BLEND]
        assert found.estimate is not None
        return found.estimate.is_determined(allowed_pixels(Visible().target, found.pixels))

    def estimate(self, kind: str) -> float:
        """Return the estimate of an image, raw or blended."""
        estimate = self.seen[kind].estimate
        assert estimate is not None
        return estimate.fraction


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
    rows = [points(recording, slice_spp, guides, run) for run in range(runs)]
    found: list[Figure] = []
    for target in TARGETS:
        needed = {kind: [spp_at(row, kind, target) for row in rows] for kind in KINDS}
        for kind, spp in needed.items():
            known = [one for one in spp if one is not None]
            if len(known) == runs:
                found.append(figure(f"{kind}: spp at {target:.2%}", known, "spp"))
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
    rows = [by_peers(recording, slice_spp, guides, run) for run in range(runs)]
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
    rows = []
    for run in range(runs):
        order = np.random.default_rng(run).permutation(len(recording))
        rows.append(
            [
                Point(spp=one.spp, wrong={BLEND: one.wrong}, seen={BLEND: one.seen}, is_look=True)
                for one in looks(recording, slice_spp, order, denoise, metric)
            ]
        )
    found: list[Figure] = []
    for target in TARGETS:
        needed = [one for row in rows if (one := spp_at(row, BLEND, target)) is not None]
        if len(needed) == runs:
            found.append(figure(f"spp at {target:.2%}", needed, "spp"))
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
    rows = []
    for run in range(runs):
        order = np.random.default_rng(run).permutation(len(recording))
        rows.append(
            [
                Point(spp=one.spp, wrong={RAW: one.raw, BLEND: one.blend}, seen={})
                for one in shares(recording, slice_spp, order, denoise, metric)
            ]
        )
    found = []
    for target, kind in product(TARGETS, (RAW, BLEND)):
        needed = [one for row in rows if (one := spp_at(row, kind, target)) is not None]
        if len(needed) == runs:
            found.append(figure(f"{kind}: spp at {target:.2%}", needed, "spp"))
    return found


def points(
    recording: NDArray[np.float32], slice_spp: int, guides: NDArray[np.float32], run: int
) -> list[Point]:
    """Return the looks of a job, and points between, as long as half of the recording remains."""
    order = np.random.default_rng(run).permutation(len(recording))
    spec = JobSpec(
        slice_spp=slice_spp,
        step=4 * slice_spp,
        max_spp=len(recording) // 8 * 4 * slice_spp,
        denoise={"name": "oidn"},
    )
    plan, metric = Plan.of(spec), CompiledVisibleDifferences(View())
    total, sums = recording.sum(axis=0, dtype=np.float64), np.zeros((4, *recording.shape[1:]))
    row: list[Point] = []
    between = plan
    for slices in range(1, plan.stop + 1):
        sums[(slices - 1) % 4] += recording[order[slices - 1]]
        is_look = plan.is_point(slices)
        if is_look or between.is_point(slices):
            between = between.with_point(slices, None)
            reference = (total - sums.sum(axis=0)) / (len(recording) - slices)
            share = slices / (len(recording) - slices)
            row.append(
                point(metric, sums, slices, slice_spp, reference.astype(np.float32), share, guides)
            )
        if is_look:
            row[-1] = replace(row[-1], is_look=True)
            ahead = row[-1].seen[BLEND].forecast(Visible().target)
            expected_spp = spec.rule.behaviour.expected_end_spp(
                None if ahead is None else ahead.spp
            )
            plan = plan.with_point(slices, expected_spp)
    return row


def point(
    metric: CompiledVisibleDifferences,
    sums: NDArray[np.float64],
    slices: int,
    slice_spp: int,
    reference: Image,
    share: float,
    guides: NDArray[np.float32],
) -> Point:
    """Return the point of an image; `share` is its samples over those of the reference."""
    spp = slices * slice_spp
    quarters = [Half((one / (slices // 4)).astype(np.float32), spp // 4) for one in sums]
    image = (sums.sum(axis=0) / slices).astype(np.float32)
    halves = [
        Half(((sums[one] + sums[one + 2]) / (slices / 2)).astype(np.float32), spp // 2)
        for one in (0, 1)
    ]
    denoise, _ = oidn.denoiser(tuple(guides), metric.view)
    began, used = time.perf_counter(), time.process_time()
    blend, error = blended(image, (halves[0], halves[1]), denoise, metric.view)
    seconds, core_seconds = time.perf_counter() - began, time.process_time() - used
    # The other halves have noise of their own, as the reference has.
    other = (quarters[0].mean + quarters[1].mean - quarters[2].mean - quarters[3].mean) / 4
    noise = (np.sqrt(share) * other).astype(np.float32)
    difference = halves[0].mean - halves[1].mean
    wrong = {
        kind: wrong_share(metric, reference, noise, one, own)
        for kind, one, own in (
            (RAW, image, difference * np.float32(0.5)),
            (DENOISED, blend.denoised, error.likely.noise),
            (BLEND, blend.image, error.likely.noise),
        )
    }
    return Point(
        spp=spp,
        wrong=wrong,
        seen={
            RAW: Evidence(spp, image, (halves[0], halves[1]), metric),
            BLEND: Evidence(spp, blend.image, None, metric, error),
            DENOISED: Evidence(spp, blend.denoised, None, metric),
        },
        seconds=seconds,
        core_seconds=core_seconds,
    )


def by_peers(
    recording: NDArray[np.float32], slice_spp: int, guides: NDArray[np.float32], run: int
) -> dict[str, tuple[float, float]]:
    """Return the samples of each renderer that stops, and the share that is wrong then."""
    order = np.random.default_rng(run).permutation(len(recording))
    metric, found = CompiledVisibleDifferences(View()), {}
    denoise, _ = oidn.denoiser(tuple(guides), metric.view)
    mixed = recording[order]
    for one in delivered(mixed, slice_spp, denoise, metric.view):
        left = len(mixed) - one.slices
        reference = mixed[one.slices :].mean(axis=0, dtype=np.float64).astype(np.float32)
        first, second, third, fourth = (
            mixed[quarter : one.slices : 4].mean(axis=0, dtype=np.float64) for quarter in range(4)
        )
        other = (first + second - third - fourth) / 4
        noise = (np.sqrt(one.slices / left) * other).astype(np.float32)
        own = ((first + third - second - fourth) / 4).astype(np.float32)
        found[one.peer] = one.spp, wrong_share(metric, reference, noise, one.image, own)
    return found


def spp_at(row: Sequence[Point], kind: str, target: float) -> float | None:
    """Return the samples from which on at most this share is wrong, between two points."""
    for before, after in zip(reversed(row[:-1]), reversed(row[1:]), strict=True):
        if before.wrong[kind] > target >= after.wrong[kind]:
            high, low = (math.log(max(one.wrong[kind], 1e-6)) for one in (before, after))
            part = (high - math.log(target)) / (high - low)
            return float(before.spp * (after.spp / before.spp) ** part)
    return float(row[0].spp) if row[-1].wrong[kind] <= target else None


def ended(row: Sequence[Point], kind: str, name: str) -> Point | None:
    """Return where a rule ends the job; None if the recording is too short."""
    rule = create_rule(name)
    for one in row:
        if (one.is_look or kind == RAW) and rule.judge(one.seen[kind]).stop:
            return one
    return None


#: What is measured of a scene: the name that its figures have, and how they are made.
PARTS: Final[dict[str, tuple[Callable[[str], str], Callable[..., list[Figure]]]]] = {
    "frames": (str, figures),
    "zones": (zones_of, figures_by_zones),
    "peers": (peers_of, figures_of_peers),
    "best": (best_of, figures_at_best),
}

if __name__ == "__main__":
    main()
