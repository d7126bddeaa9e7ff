"""What each rule spends on one series of slices, and how many pixels are then visibly wrong.

Every rule sees the same slices, ours with a job's defaults, and stops on its own.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from bench.experiment.contenders import TARGET
from bench.experiment.other_rules import CyclesAdaptive, CyclesThreshold, LuxCoreHalt
from bench.experiment.renders import SLICE_SPP
from bench.experiment.series import Measured, evidence
from bench.experiment.truth import truth_at
from plateau.farm.images.exr import decode_image, decode_partial
from plateau.farm.model.spec import JobSpec
from plateau.metric import Evidence, View, create_rule
from plateau.metric.compiled import CompiledVisibleDifferences
from plateau.service.judging.merge import Merge

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from bench.experiment.renders import Rendered
    from plateau.farm.images.exr import Pixels
    from plateau.metric import Image, Rule

#: The basis of comparison: this many spp, whatever the image looks like.
FIXED_SPP: Final = 10_000
FIXED: Final = f"fixed {FIXED_SPP:,} spp"
#: Spp between checks of LuxCore's rule. Its own 64 are no whole number of slices.
LUXCORE_STEPS: Final = (SLICE_SPP, 2 * SLICE_SPP)
CYCLES: Final = "Cycles, whole image"
CYCLES_ADAPTIVE: Final = "Cycles, pixel by pixel"
OURS: Final = ("visible", f"visible, {TARGET * 100:g} %", "reverse")
LUXCORE: Final = tuple(f"LuxCore, every {step} spp" for step in LUXCORE_STEPS)
#: In the order of the tables.
RULES: Final = (*OURS, *LUXCORE, CYCLES, CYCLES_ADAPTIVE)


@dataclass(frozen=True)
class Stop:
    """Where one rule ended one series."""

    spp: float  #: mean of the pixels; the whole cap if the rule did not end the series
    ended: bool  #: whether the rule ended the series
    looks: int  #: evaluations by the rule
    seen: int  #: D(independent reference, image) then, in pixels
    unfinished: int | None = None  #: pixels; None for a rule that judges only the whole image


@dataclass(frozen=True)
class Left:
    """How many pixels are still visibly wrong."""

    pixels: float
    how: str  #: how well that is known: "", "about" or "at most"


@dataclass
class Spending:
    """Where all rules ended one series, and what that costs on this machine."""

    name: str
    pixels: int
    cap: int
    spp: list[int] = field(default_factory=list)  #: of each comparison with the reference
    truth: list[int] = field(default_factory=list)  #: D(independent reference, I_n), in pixels
    stops: dict[str, Stop] = field(default_factory=dict)  #: by rule
    spp_s: list[float] = field(default_factory=list)  #: core seconds of one spp, slice by slice
    look_s: dict[str, list[float]] = field(default_factory=dict)  #: of an evaluation, by rule
    others: float = 0.0  #: other work's share of the cores while slices were timed

    @property
    def measured(self) -> Measured:
        """The truth of the series."""
        return Measured(self.name, self.pixels, self.cap, self.spp, self.truth)

    def left(self, rule: str) -> Left:
        """Return how many pixels were still visibly wrong where a rule left the image."""
        return self.left_by(self.stops[rule], evenly=rule != CYCLES_ADAPTIVE)

    def left_by(self, stop: Stop, *, evenly: bool = True) -> Left:
        """Return how many pixels were still visibly wrong, without the noise of the reference.

        docs/science/paper.md says how. If pixels differ in spp, the reference's noise is taken to
        add as much as to an image whose samples are spread evenly. Late in a series its part is
        unknown, and the count against the reference is an upper bound.
        """
        true = truth_at(self.measured, stop.spp)
        if true is None or not stop.seen:
            return Left(stop.seen, "at most" if stop.seen else "")
        if evenly:
            return Left(true, "")
        seen_evenly = float(np.interp(np.log(stop.spp), np.log(self.spp), self.truth))
        return Left(stop.seen * true / max(seen_evenly, 1.0), "about")

    def write(self, path: Path) -> None:
        """Write it as JSON."""
        path.write_text(json.dumps(asdict(self)))

    @classmethod
    def read(cls, path: Path) -> Spending:
        """Return what `write` wrote."""
        known: dict[str, Any] = json.loads(path.read_text())
        known["stops"] = {rule: Stop(**stop) for rule, stop in known["stops"].items()}
        return cls(**known)


@dataclass
class WholeImage:
    """A rule that judges the merged image as a whole."""

    step: int  #: spp between two evaluations
    stops: Callable[[Evidence], bool]
    looks: int = 0


def whole_image_rules(view: View) -> dict[str, WholeImage]:
    """Return new rules by name, except the one that ends pixels one by one."""
    step = JobSpec().step
    ours: dict[str, Rule] = {
        "visible": create_rule("visible"),
        OURS[1]: create_rule("visible", target=TARGET),
        "reverse": create_rule("reverse"),
    }
    rules = {name: WholeImage(step, _by_verdict(rule)) for name, rule in ours.items()}
    for name, luxcore_step in zip(LUXCORE, LUXCORE_STEPS, strict=True):
        rules[name] = WholeImage(luxcore_step, _by_change(LuxCoreHalt(view)))
    # A is exactly half of the samples after each pair of slices.
    rules[CYCLES] = WholeImage(2 * SLICE_SPP, _by_error(CyclesThreshold()))
    return rules


def _by_verdict(rule: Rule) -> Callable[[Evidence], bool]:
    return lambda seen: rule.judge(seen).stop


def _by_change(rule: LuxCoreHalt) -> Callable[[Evidence], bool]:
    return lambda seen: rule.stops(seen.spp, seen.image)


def _by_error(rule: CyclesThreshold) -> Callable[[Evidence], bool]:
    def stops(seen: Evidence) -> bool:
        assert seen.halves is not None
        return rule.stops(seen.spp, seen.image, seen.halves[0].mean)

    return stops


def spend(renders: Rendered) -> Spending:
    """Let every rule end a series, and compare the image that it left with the reference."""
    metric = CompiledVisibleDifferences(View())
    reference = metric.percept(decode_image(renders.reference.read_bytes()))
    spent = Spending(renders.case.name, renders.size.pixels, renders.size.cap)
    merge, rules, adaptive = Merge(slice_spp=SLICE_SPP), whole_image_rules(metric.view), _Pairs()

    def seen_in(image: Image) -> int:
        return metric.compare(reference, metric.percept(image)).count

    for path in sorted(renders.slices.glob("*.exr")):
        film = decode_partial(path.read_bytes()).pixels
        merge.add(film)
        seen = evidence(merge, metric)
        spent.spp.append(seen.spp)
        spent.truth.append(metric.compare(reference, seen.percept).count)
        for name, rule in list(rules.items()):
            if seen.spp % rule.step:
                continue
            rule.looks += 1
            if rule.stops(seen):
                spent.stops[name] = Stop(seen.spp, True, rule.looks, spent.truth[-1])
                del rules[name]
        if adaptive.ends_with(film):
            spent.stops[CYCLES_ADAPTIVE] = adaptive.stop(seen_in(adaptive.rule.image))
    for name, rule in rules.items():
        unfinished = _unfinished(merge) if name == CYCLES else None
        spent.stops[name] = Stop(merge.spp, False, rule.looks, spent.truth[-1], unfinished)
    if CYCLES_ADAPTIVE not in spent.stops:
        spent.stops[CYCLES_ADAPTIVE] = adaptive.stop(seen_in(adaptive.rule.image))
    return spent


def _unfinished(merge: Merge) -> int:
    """Return how many pixels keep Cycles' rule from ending."""
    halves = merge.halves()
    assert halves is not None
    return int((~CyclesThreshold().done(merge.image(), halves[0][0])).sum())


class _Pairs:
    """Cycles' adaptive sampling, given one slice after the other."""

    def __init__(self) -> None:
        self.rule = CyclesAdaptive()
        self.looks = 0
        self.ended = False
        self._first: Pixels | None = None

    def ends_with(self, film: Pixels) -> bool:
        """Return whether the last pixel ends with this slice."""
        if self.ended:
            return False
        if self._first is None:
            self._first = film
            return False
        self.looks += 1
        self.ended = self.rule.add(self._first, film, 2 * SLICE_SPP)
        self._first = None
        return self.ended

    def stop(self, seen: int) -> Stop:
        """Return its present state as a stop."""
        rule = self.rule
        return Stop(rule.mean_spp, self.ended, self.looks, seen, rule.active_pixels)
