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
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bench import ROOT
from bench.allocating.recordings import SCENES, add_options, recorded
from bench.support import markdown
from bench.support.report import Figure, figure, last_figures, last_report, renewed, write_report
from plateau.farm.model.plan import Plan
from plateau.farm.model.spec import JobSpec
from plateau.metric import Evidence, Half, View, Visible, allowed_pixels, blended, create_rule
from plateau.metric.compiled import CompiledVisibleDifferences
from plateau.service.monitor.denoising import oidn

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from bench.experiment.cases import Case
    from plateau.metric import Image

TARGETS = (0.001, 0.0002)
RAW, DENOISED, BLEND = "raw", "denoised alone", "blend"
KINDS = (RAW, DENOISED, BLEND)
#: The rules that are tried on the blend: Plateau's own, and the paper's.
OWN = Visible.name
RULES = (OWN, "reverse", "successive", "multiple", "myszkowski")
#: Shares of the pixels from which on an estimate is compared with the truth.
ENOUGH = 0.001
_NOTES = (
    "Images are put together from recorded slices; the rest of the recording is the reference.",
    "What the reference's own noise makes visible is estimated, and taken from what is counted.",
)


@dataclass(frozen=True, kw_only=True)
class Point:
    """An image of so many samples: the shares of its pixels that are visibly wrong."""

    spp: int
    wrong: dict[str, float]  #: of each kind, counted
    seen: dict[str, Evidence]
    seconds: float  #: of the look, and of its cores
    core_seconds: float

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
    add_options(parser)
    asked = parser.parse_args()
    kept = last_figures("denoising")
    settings = last_report("denoising")["settings"].get("scenes", {})
    for name in asked.cases:
        case = SCENES[name]
        recording = recorded(case, asked.pixels, asked.spp, asked.slice_spp, asked.data)
        guides = guides_of(case, asked.pixels, asked.data)
        scene = f"{name}, {asked.pixels} px"
        settings[scene] = {"spp": asked.spp, "slice_spp": asked.slice_spp, "runs": asked.runs}
        found = figures(recording, asked.slice_spp, guides, asked.runs)
        kept = renewed(kept, scene, found)
        for one in found:
            print(scene, one.name, one.value, file=sys.stderr)
    report = write_report("denoising", kept, settings={"scenes": settings}, notes=_NOTES)
    markdown.fill(markdown.DOCS / "denoising.md", tables(report))


def guides_of(case: Case, pixels: int, data: Path) -> NDArray[np.float32]:
    """Return albedo and normals of a scene, (2, H, W, 3)."""
    file = data / f"{case.slug}-{pixels}.guides.npy"
    if not file.exists():
        command = [case.family, str(pixels), str(file)]
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


def points(
    recording: NDArray[np.float32], slice_spp: int, guides: NDArray[np.float32], run: int
) -> list[Point]:
    """Return the points of a job's curve, as long as half of the recording remains."""
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
    for slices in range(1, plan.stop + 1):
        sums[(slices - 1) % 4] += recording[order[slices - 1]]
        if plan.is_point(slices):
            reference = (total - sums.sum(axis=0)) / (len(recording) - slices)
            share = slices / (len(recording) - slices)
            row.append(
                point(metric, sums, slices, slice_spp, reference.astype(np.float32), share, guides)
            )
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
    percept, difference = metric.percept(reference), halves[0].mean - halves[1].mean
    wrong = {
        kind: max(0.0, _wrong(metric, percept, one) - _by_noise(metric, reference, own, noise))
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


def _wrong(metric: CompiledVisibleDifferences, reference: Any, image: Image) -> float:
    visible = metric.compare(reference, metric.percept(image)).visible
    return float(np.count_nonzero(visible) / visible.size)


def _by_noise(
    metric: CompiledVisibleDifferences, reference: Image, own: Image, noise: Image
) -> float:
    """Return the share of the pixels that the reference's noise makes visible beside an image's."""
    clean = metric.percept(reference)
    shares = [
        _wrong(metric, clean, reference + np.float32(sign) * own + more)
        for sign in (1, -1)
        for more in (noise, np.float32(0))
    ]
    return (shares[0] + shares[2] - shares[1] - shares[3]) / 2


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
        if rule.judge(one.seen[kind]).stop:
            return one
    return None


def tables(report: dict[str, Any]) -> dict[str, str]:
    """Return every table by the name of its place in the document."""
    found = {one["name"]: one for one in report["figures"]}
    names = list(report["settings"]["scenes"])

    def number(scene: str, what: str, form: str = ",.0f") -> str:
        one = found.get(f"{scene}: {what}")
        return "–" if one is None else format(one["value"], form)

    def times(scene: str, what: str) -> str:
        raw, blend = (found.get(f"{scene}: {kind}: {what}") for kind in (RAW, BLEND))
        return "–" if raw is None or blend is None else f"{raw['value'] / blend['value']:.2f}"

    def spread(scene: str, what: str) -> str:
        one = found.get(f"{scene}: {what}")
        return "–" if one is None else markdown.spread(one, 2)

    needed = [
        [
            scene,
            *(
                f"{number(scene, f'{RAW}: {what}')} / {number(scene, f'{BLEND}: {what}')} "
                f"= {times(scene, what)}"
                for what in (*(f"spp at {target:.2%}" for target in TARGETS), f"{OWN}: spp")
            ),
            *(number(scene, f"{kind}: {OWN}: wrong", ".3%") for kind in (RAW, BLEND)),
        ]
        for scene in names
    ]
    quality = [
        [
            scene,
            *(spread(scene, f"{kind}: wrong, of raw") for kind in (DENOISED, BLEND)),
            *(spread(scene, f"{kind}: estimate / truth") for kind in (RAW, BLEND)),
        ]
        for scene in names
    ]
    rules = [
        [
            f"{scene}, {kind}",
            *(
                f"{number(scene, f'{kind}: {rule}: spp')} / "
                f"{number(scene, f'{kind}: {rule}: wrong', '.3%')}"
                for rule in RULES
            ),
        ]
        for scene, kind in product(names, (BLEND, DENOISED))
    ]
    told = [
        [
            scene,
            *(
                number(scene, f"{BLEND}: {name}")
                for name in ("points", "determined", "determined, and twice as wrong")
            ),
        ]
        for scene in names
    ]
    return {
        "denoising-rules": markdown.table(["scene", *(f"`{rule}`" for rule in RULES)], rules),
        "denoising-determined": markdown.table(
            ["scene", "points", "determined", "of these, twice as wrong"], told
        ),
        "denoising": markdown.table(
            ["scene", "0.10 % wrong", "0.02 % wrong", "the rule's end", "wrong then, raw", "blend"],
            needed,
        ),
        "denoising-quality": markdown.table(
            [
                "scene",
                "denoised alone, wrong pixels of raw",
                "blend, wrong pixels of raw",
                "raw, estimate / truth",
                "blend, estimate / truth",
            ],
            quality,
        ),
    }


if __name__ == "__main__":
    main()
