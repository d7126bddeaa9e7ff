"""Denoised jobs of whole frames: recordings replayed, and held against the rest of themselves."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from bench.allocating.denoising_tables import BLEND, DENOISED, RAW
from bench.allocating.peers import delivered
from bench.allocating.truth import quarters_noise, wrong_share
from plateau.farm.model.slices.plan import Plan
from plateau.farm.model.spec import JobSpec
from plateau.metric import Evidence, Half, View, Visible, allowed_pixels, blended, create_rule
from plateau.metric.compiled import CompiledVisibleDifferences
from plateau.service.monitor.denoising import oidn

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from plateau.metric import Image


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
    quarters = (sums / (slices // 4)).astype(np.float32)
    image = (sums.sum(axis=0) / slices).astype(np.float32)
    halves = [
        Half(((sums[one] + sums[one + 2]) / (slices / 2)).astype(np.float32), spp // 2)
        for one in (0, 1)
    ]
    denoise, _ = oidn.denoiser(tuple(guides), metric.view)
    began, used = time.perf_counter(), time.process_time()
    blend, error = blended(image, (halves[0], halves[1]), denoise, metric.view)
    seconds, core_seconds = time.perf_counter() - began, time.process_time() - used
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
        seconds=seconds,
        core_seconds=core_seconds,
    )


def by_peers(
    recording: NDArray[np.float32],
    slice_spp: int,
    guides: NDArray[np.float32],
    order: NDArray[np.intp],
) -> dict[str, tuple[float, float]]:
    """Return the samples of each renderer that stops, and the share that is wrong then."""
    metric, found = CompiledVisibleDifferences(View()), {}
    denoise, _ = oidn.denoiser(tuple(guides), metric.view)
    mixed = recording[order]
    for one in delivered(mixed, slice_spp, denoise, metric.view):
        left = len(mixed) - one.slices
        reference = mixed[one.slices :].mean(axis=0, dtype=np.float64).astype(np.float32)
        quarters = [
            mixed[quarter : one.slices : 4].mean(axis=0, dtype=np.float64) for quarter in range(4)
        ]
        own, noise = quarters_noise(quarters, one.slices / left)
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
