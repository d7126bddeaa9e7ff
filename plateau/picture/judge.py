"""Judges a job's merged image: by the rule that ends it and the rules it watches; and the curve."""

import math
from concurrent.futures import Future
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from plateau.farm.model.slices.plan import Plan
from plateau.farm.model.slices.rounds import Round
from plateau.farm.model.spec import JobSpec
from plateau.metric import Estimate, Evidence, Rule, Verdict, View, create_rule
from plateau.metric.blend import Blend
from plateau.metric.compiled import CompiledVisibleDifferences
from plateau.metric.compiled.predictor import COMPARISONS_BEFORE_KEEPING
from plateau.metric.cvvdp import DISPLAYS, ColorVideoVDP
from plateau.metric.rows import beside
from plateau.metric.rules.base import Memory
from plateau.picture.allotment import Allotment, allotment
from plateau.picture.denoised import Denoised
from plateau.picture.merged_image import MergedImage
from plateau.picture.point import of_curve, of_denoising, of_estimate, of_merge, of_rule
from plateau.picture.result_files import NoiseMaps, flaw_of
from plateau.rules import CURVE, NOISE


def warm_up() -> None:
    """Compile the metric's kernels, or load them from their cache, before a job waits for them.

    It takes 10 to 30 s the first time on a machine, and less than 1 s later.
    """
    metric, image = CompiledVisibleDifferences(View()), np.zeros((16, 16, 3), np.float32)
    reference = metric.percept(image)
    for _ in range(COMPARISONS_BEFORE_KEEPING + 2):  # streamed, and then kept
        metric.compare(reference, metric.percept(image))
    metric.denoised(image, image)
    eye = ColorVideoVDP(DISPLAYS["standard_fhd"])
    eye.compare(eye.percept(image), eye.percept(image), heat=True, zone_size=16)
    frame = eye.video(24).percept(image)
    eye.compare(frame, frame, heat=True)


#: Rules that every job's judge evaluates, so that a continuation has their memory.
REMEMBERED_ANYWAY: Final = (CURVE, NOISE)


@dataclass(frozen=True)
class Judgement:
    """One evaluation: the point of the curve, and what the job's own rule said."""

    point: dict[str, Any]
    verdict: Verdict
    #: The spp at which the job is likely to end, by this image and those before; None if unknown.
    expected_spp: int | None
    #: Why the image cannot be a result, whatever the rules say; None if it can.
    flaw: str | None
    #: The round that the image decides; None where the job is allocated by frame.
    decided: Round | None = None


class Judge:
    """The rules of one job, with their memory.

    The curve is that of the rule `reverse`, whatever rule ends the job. Unless the job names
    `reverse`, the judge adds it with the paper's parameters. It adds `visible` in the same way,
    for a job that continues this one.
    """

    def __init__(self, spec: JobSpec) -> None:
        self._metric = CompiledVisibleDifferences(View(**spec.view.of_display()))
        self._own = spec.rule.name
        self._before: tuple[int, float] | None = None  # where its value was one evaluation ago
        self._min_spp, self._step = spec.min_spp or 0, spec.step
        self._rules: dict[str, Rule] = {
            rule.name: create_rule(**rule.model_dump()) for rule in (spec.rule, *spec.watch)
        }
        self._shown = tuple(self._rules)
        self._by_quality = spec.by_quality
        # Of the last evaluation, each with its spp
        self._curve_map: tuple[int, NDArray[np.bool_]] | None = None
        self._noise_maps: tuple[int, NoiseMaps] | None = None
        self._target = spec.noise_target or create_rule(NOISE).noise_target
        for name in REMEMBERED_ANYWAY:
            if name not in self._rules:
                self._rules[name] = create_rule(name)

    def judge(
        self, merge: MergedImage, plan: Plan | None = None, *, denoised: Denoised | None = None
    ) -> Judgement:
        """Evaluate every rule on the image; to be called once a point, by rising spp.

        Parameters
        ----------
        merge
            The merged image.
        plan
            Of the job; none is needed of a job that is allocated by frame.
        denoised
            The merged image denoised, if that is to be judged.
        """
        raw = self._evidence(merge)
        evidence = _of_denoised(raw, denoised)
        allotted = self._allotted(evidence, merge, plan, denoised)
        verdicts = self._verdicts(evidence)
        visible = verdicts[CURVE].visible
        assert visible is not None  # it always judges a map
        self._curve_map = (merge.spp, visible)
        curve = of_curve(verdicts[CURVE])
        flaw = flaw_of(evidence.image) if curve["non_finite_pixels"] else None
        # An image that cannot be a result has no estimate, which would be one of its other pixels.
        estimate = None if flaw else evidence.estimate
        self._noise_maps = merge.spp, self._maps_of(evidence, estimate)
        forecast_spp, decided = None, None
        if self._target and not flaw:
            if allotted is not None:
                decided, forecast_spp = allotted.result()
            elif self._rules[self._own].noise_target is not None:
                forecast_spp = evidence.forecast(self._target)
        point = {
            **of_merge(merge),
            **curve,
            **of_estimate(estimate),
            **({} if denoised is None or flaw else of_denoising(evidence, raw, self._target)),
            # By the image alone, so that it does not depend on which monitor judged those before.
            "expected_spp": self._expected_spp(forecast_spp),
            "rules": {
                name: of_rule(verdicts[name], stop=verdicts[name].stop and not flaw)
                for name in self._shown
            },
        }
        own = verdicts[self._own]
        expected = self._expected_spp(forecast_spp, self._crossing(own, merge.spp))
        return Judgement(point, self._not_too_early(own, merge.spp), expected, flaw, decided)

    def _allotted(
        self, evidence: Evidence, merge: MergedImage, plan: Plan | None, denoised: Denoised | None
    ) -> Future[Allotment] | None:
        """Begin to choose the zones of a round; None where the image chooses none."""
        if not self._target or plan is None or merge.zone_spp is None:
            return None
        if (chosen_by := _by_other_halves(evidence, merge, denoised)) is None:
            return None
        quality = self._rules[self._own].quality_target
        decide = partial(allotment, chosen_by, self._target, plan, quality_target=quality)
        return beside(partial(decide, spp=merge.zone_spp))

    def _verdicts(self, evidence: Evidence) -> dict[str, Verdict]:
        """Have all rules judge: those by the quality, and the others beside them."""
        by_quality = {name for name, rule in self._rules.items() if rule.by_quality}
        if not by_quality:
            return {name: rule.judge(evidence) for name, rule in self._rules.items()}
        evidence.prepare()
        others = beside(
            lambda: {
                name: rule.judge(evidence)
                for name, rule in self._rules.items()
                if name not in by_quality
            }
        )
        own = {name: self._rules[name].judge(evidence) for name in by_quality}
        return own | others.result()

    def _evidence(self, merge: MergedImage) -> Evidence:
        image = merge.image()
        return Evidence(
            spp=merge.spp,
            image=image,
            halves=merge.halves(),
            quarters=merge.quarters(),
            light=merge.is_lit,
            metric=self._metric,
        )

    def _expected_spp(
        self, forecast_spp: int | None, crossing_spp: int | None = None
    ) -> int | None:
        """Return where the job is likely to end: see the rule's `expected_end_spp`."""
        spp = self._rules[self._own].expected_end_spp(forecast_spp, crossing_spp)
        return None if spp is None else max(spp, self._min_spp)

    def _crossing(self, own: Verdict, spp: int) -> int | None:
        """Return where the line through the last two values of the rule falls to its limit."""
        before, self._before = self._before, None if own.value is None else (spp, own.value)
        if before is None or own.value is None or own.limit is None:
            return None
        return _crossing(before, (spp, own.value), own.limit)

    def _not_too_early(self, verdict: Verdict, spp: int) -> Verdict:
        """Return the rule's verdict, changed so that it ends no job before its `min_spp`."""
        if not verdict.stop or not self._min_spp or spp - self._step >= self._min_spp:
            return verdict
        stop = spp >= self._min_spp
        may = "could not end earlier" if stop else "cannot end yet"
        return replace(
            verdict, stop=stop, reason=f"{verdict.reason}; min_spp is {self._min_spp}, so it {may}"
        )

    def visible_map(
        self, merge: MergedImage, blend: Blend | None = None
    ) -> NDArray[np.bool_] | None:
        """Return where the image differs visibly from the first image of the curve.

        It is the merged image, or its blend with its denoised self.
        """
        if self._curve_map is not None and self._curve_map[0] == merge.spp:
            return self._curve_map[1]
        first = self._rules[CURVE].memory().images.get("first")
        if first is None:
            return None
        image = merge.image() if blend is None else blend.seen
        evidence = Evidence(spp=merge.spp, image=image, halves=None, metric=self._metric)
        difference = self._metric.compare(self._metric.percept(first), evidence.percept)
        return difference.visible & evidence.finite if difference.non_finite else difference.visible

    def noise_maps(self, merge: MergedImage, denoised: Denoised | None = None) -> NoiseMaps:
        """Return where noise is left to see in the merged image, or in the image denoised."""
        if self._noise_maps is None or self._noise_maps[0] != merge.spp:
            evidence = _of_denoised(self._evidence(merge), denoised)
            estimate = None if flaw_of(evidence.image) else evidence.estimate
            self._noise_maps = merge.spp, self._maps_of(evidence, estimate)
        return self._noise_maps[1]

    def _maps_of(self, evidence: Evidence, estimate: Estimate | None) -> NoiseMaps:
        if estimate is None:
            return NoiseMaps()
        quality = evidence.quality if self._by_quality else None
        return NoiseMaps(estimate.visible, None if quality is None else quality.heat)

    def memory(self) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        """Return the rules' memory for a checkpoint: numbers, and images by name."""
        memories = {name: rule.memory() for name, rule in self._rules.items()}
        numbers = {name: memory.numbers for name, memory in memories.items()}
        images = {
            f"{name}:{image}": pixels
            for name, memory in memories.items()
            for image, pixels in memory.images.items()
        }
        return numbers, images

    def recall(self, numbers: dict[str, Any], images: dict[str, NDArray[Any]]) -> None:
        """Restore what `memory` returned; a rule that it does not name starts without memory."""
        for name, rule in self._rules.items():
            if name not in numbers:
                continue
            own = {
                image.removeprefix(f"{name}:"): pixels
                for image, pixels in images.items()
                if image.startswith(f"{name}:")
            }
            rule.recall(Memory(numbers[name], own))


def _of_denoised(raw: Evidence, found: Denoised | None) -> Evidence:
    return raw if found is None else replace(raw, image=found.blend.seen, error=found.error)


def _by_other_halves(
    evidence: Evidence, merge: MergedImage, denoised: Denoised | None
) -> Evidence | None:
    """Return the evidence by which zones are chosen; None without halves."""
    if denoised is not None:
        return replace(evidence, error=denoised.others) if denoised.others else None
    halves = merge.other_halves()
    return replace(evidence, halves=halves) if halves else None


def _crossing(before: tuple[int, float], now: tuple[int, float], limit: float) -> int | None:
    """Return the spp at which the line through two values falls to the limit; None if it rises."""
    (earlier, higher), (spp, value) = before, now
    if value <= limit:
        return spp
    if value >= higher:
        return None
    return math.ceil(spp + (spp - earlier) * (value - limit) / (higher - value))
