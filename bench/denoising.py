"""What denoising saves, and whether its error is known: `make bench-denoising`.

Images of more and more samples are put together from recorded slices: as they are, denoised, and as
the farm delivers them, blended. The rest of the recording says how many pixels are visibly wrong.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from statistics import median
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from bench.support.recordings import (
    HARD,
    PAPER,
    RECORDED,
    SCENES,
    guides_of,
    parser_of,
    recorded,
    recordings_row,
)
from bench.support.report import Table, spread, write_report
from plateau.farm.model.slices.plan import Plan
from plateau.farm.model.spec import JobSpec
from plateau.metric import (
    Evidence,
    Half,
    Image,
    Visible,
    VisibleDifferences,
    blended,
)
from plateau.metric.compiled import CompiledVisibleDifferences
from plateau.picture.denoising import oidn

TARGETS: Final = (0.001, 0.0002)
RAW, DENOISED, BLEND = "raw", "denoised alone", "blend"
#: Shares of the pixels from which on an estimate is compared with the truth.
ENOUGH: Final = 0.001
_NOTES: Final = (
    "Images are put together from recorded slices; the rest of the recording is the reference.",
    "What the reference's own noise makes visible is estimated, and taken from what is counted.",
)
_HEADS: Final = {
    "denoising": (
        *("scene", "0.10 % wrong", "0.02 % wrong", "the rule's end"),
        *("wrong then, raw", "blend"),
    ),
    "denoising-quality": (
        *("scene", "denoised alone, wrong pixels of raw", "blend, wrong pixels of raw"),
        *("raw, estimate / truth", "blend, estimate / truth"),
    ),
}


def main() -> None:
    every = SCENES | HARD
    asked = parser_of(__doc__, every).parse_args()
    for name in asked.cases:
        recording, guides = recorded(every[name], asked), guides_of(every[name], asked)
        rows = [
            points(recording, asked.slice_spp, guides, order)
            for order in (
                np.random.default_rng(run).permutation(len(recording)) for run in range(asked.runs)
            )
        ]
        recordings = [RECORDED, recordings_row(name, asked, asked.runs)]
        write_report(
            "denoising",
            {**tables(f"{name}, {asked.pixels} px", rows), "denoising-recordings": recordings},
            settings={},
            notes=_NOTES,
            document="denoising.md",
        )


def tables(scene: str, rows: Sequence[Sequence["Point"]]) -> dict[str, Table]:
    """Return what the runs found of a scene."""
    every = [point for row in rows for point in row]
    at_end = {kind: stops(rows, kind) for kind in (RAW, BLEND)}
    needed = [
        *({kind: needs(rows, kind, target) for kind in (RAW, BLEND)} for target in TARGETS),
        {kind: None if end is None else end[0] for kind, end in at_end.items()},
    ]

    def wrong_of_raw(kind: str) -> str:
        return _spread([p.wrong[kind] / p.wrong[RAW] for p in every if p.wrong[RAW] >= ENOUGH])

    def estimated(kind: str) -> str:
        found = [p.estimate(kind) / p.wrong[kind] for p in every if p.wrong[kind] >= ENOUGH]
        return _spread(found)

    content = {
        "denoising": [
            [
                scene,
                *map(_fewer, needed),
                *("–" if end is None else f"{end[1]:.3%}" for end in at_end.values()),
            ]
        ],
        "denoising-quality": [
            [
                *(scene, wrong_of_raw(DENOISED), wrong_of_raw(BLEND)),
                *(estimated(RAW), estimated(BLEND)),
            ]
        ],
    }
    return {name: [list(head), *content[name]] for name, head in _HEADS.items()}


def stops(rows: Sequence[Sequence["Point"]], kind: str) -> tuple[float, float] | None:
    """Return where `visible` ends the jobs, and what is wrong; None if it did not."""
    ends = [one for row in rows if (one := ended(row, kind)) is not None]
    if len(ends) < len(rows):
        return None
    return median(one.spp for one in ends), median(one.wrong[kind] for one in ends)


def needs(rows: Sequence[Sequence["Point"]], kind: str, target: float) -> float | None:
    """Return the samples that a target takes, if all runs come to it."""
    spp = [one for row in rows if (one := spp_at(row, kind, target)) is not None]
    return median(spp) if len(spp) == len(rows) else None


def _fewer(spp: dict[str, float | None]) -> str:
    """Return both numbers, and how many times fewer the blend's is."""
    raw, blend = spp[RAW], spp[BLEND]
    shown = ("–" if one is None else f"{one:,.0f}" for one in (raw, blend))
    times = "–" if raw is None or blend is None else f"{raw / blend:.2f}"
    return f"{' / '.join(shown)} = {times}"


def _spread(values: list[float]) -> str:
    return spread(values, 2) if values else "–"


@dataclass(frozen=True, kw_only=True)
class Point:
    """An image of so many samples: the shares of its pixels that are visibly wrong."""

    spp: float
    wrong: dict[str, float]  #: of each kind, counted
    seen: dict[str, Evidence]
    is_look: bool = False  #: whether a denoised job judges it

    def estimate(self, kind: str) -> float:
        """Return the estimate of an image, raw or blended."""
        estimate = self.seen[kind].estimate
        assert estimate is not None
        return estimate.fraction


def points(
    recording: NDArray[np.float32],
    slice_spp: int,
    guides: NDArray[np.float32],
    order: NDArray[np.intp],
) -> list[Point]:
    """Return the looks of a job, and points between, as long as half of the recording remains."""
    spec = JobSpec(
        slice_spp=slice_spp,
        step=4 * slice_spp,
        max_spp=len(recording) // 8 * 4 * slice_spp,
        denoise={"name": "oidn"},
        rule={"name": "visible"},
    )
    plan, metric = Plan.of(spec), CompiledVisibleDifferences(PAPER)
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
            expected_spp = spec.rule.behaviour.expected_end_spp(ahead)
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
    quarters = (sums / (slices // 4)).astype(np.float32)
    image = (sums.sum(axis=0) / slices).astype(np.float32)
    halves = [
        Half(((sums[one] + sums[one + 2]) / (slices / 2)).astype(np.float32), spp // 2)
        for one in (0, 1)
    ]
    denoise, _ = oidn.denoiser(tuple(guides), metric.view)
    blend, error = blended(image, (halves[0], halves[1]), denoise, metric.view)
    _, noise = quarters_noise(quarters, share)
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
    )


def spp_at(row: Sequence[Point], kind: str, target: float) -> float | None:
    """Return the samples from which on at most this share is wrong, between two points."""
    for before, after in zip(reversed(row[:-1]), reversed(row[1:]), strict=True):
        if before.wrong[kind] > target >= after.wrong[kind]:
            high, low = (math.log(max(one.wrong[kind], 1e-6)) for one in (before, after))
            part = (high - math.log(target)) / (high - low)
            return float(before.spp * (after.spp / before.spp) ** part)
    return float(row[0].spp) if row[-1].wrong[kind] <= target else None


def ended(row: Sequence[Point], kind: str) -> Point | None:
    """Return where the rule `visible` ends the job; None if the recording is too short."""
    rule = Visible()
    looks = (one for one in row if one.is_look or kind == RAW)
    return next((one for one in looks if rule.judge(one.seen[kind]).stop), None)


def quarters_noise(quarters: Any, share: float) -> tuple[Image, Image]:
    """Return noise as an image of four quarters has, and as its reference has.

    Parameters
    ----------
    quarters
        The means of each, (4, H, W, 3). The two noises are of other halves, so independent.
    share
        The image's samples over those of the reference.
    """
    first, second, third, fourth = quarters
    own = (first + third - second - fourth) / 4
    noise = np.sqrt(share) * (first + second - third - fourth) / 4
    return own.astype(np.float32), noise.astype(np.float32)


def wrong_share(
    metric: VisibleDifferences, reference: Image, noise: Image, image: Image, own: Image
) -> float:
    """Return the share of an image's pixels that are visibly wrong.

    The image has noise of its own. What the reference's noise makes visible beside that is taken
    away.
    """
    clean = metric.percept(reference)

    def visible(image: Image) -> float:
        found = metric.compare(clean, metric.percept(image)).visible
        return float(np.count_nonzero(found) / found.size)

    by_noise = [
        visible(reference + sign * own + noise) - visible(reference + sign * own)
        for sign in (np.float32(1), np.float32(-1))
    ]
    return max(0.0, visible(image) - sum(by_noise) / 2)


if __name__ == "__main__":
    main()
