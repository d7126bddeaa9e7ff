"""What each rule makes of one series of slices: the samples it spends, and what is left to see.

Every rule sees the same slices, ours as a job with their defaults would, and ends for itself.
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

#: What everything is compared with: rendering so many spp, whatever the image looks like.
FIXED_SPP: Final = 10_000
FIXED: Final = f"fixed {FIXED_SPP:,} spp"
#: Checks of LuxCore's rule, in spp: its own are 64 apart, which is no whole number of slices.
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

    #: Samples that a pixel took, on average; all that were rendered where the rule did not end it.
    spp: float
    #: Whether the rule ended the series.
    ended: bool
    #: How often the rule had looked at the image.
    looks: int
    #: D(independent reference, image) then, in pixels.
    seen: int
    #: Pixels that still wanted samples; None for a rule that does not tell them apart.
    unfinished: int | None = None


@dataclass(frozen=True)
class Left:
    """How many pixels are still visibly wrong."""

    pixels: float
    #: How well that is known: "", "about" or "at most".
    how: str


@dataclass
class Spending:
    """What all rules made of one series, and what that costs on this machine."""

    name: str
    pixels: int
    cap: int
    #: Spp at which the merged image was held against the reference.
    spp: list[int] = field(default_factory=list)
    #: D(independent reference, I_n), in pixels.
    truth: list[int] = field(default_factory=list)
    #: By rule.
    stops: dict[str, Stop] = field(default_factory=dict)
    #: Core seconds to render one spp of the whole image, run by run.
    spp_s: list[float] = field(default_factory=list)
    #: By rule: core seconds of one look, run by run.
    look_s: dict[str, list[float]] = field(default_factory=dict)
    #: Share of the cores that other work had meanwhile.
    others: float = 0.0

    @property
    def measured(self) -> Measured:
        """What is true of the series."""
        return Measured(self.name, self.pixels, self.cap, self.spp, self.truth)

    def left(self, rule: str) -> Left:
        """Return how many pixels were still visibly wrong where a rule left the image."""
        return self.left_by(self.stops[rule], evenly=rule != CYCLES_ADAPTIVE)

    def left_by(self, stop: Stop, *, evenly: bool = True) -> Left:
        """Return how many pixels were still visibly wrong, the noise of the reference taken out.

        That is done as in docs/paper.md. Where pixels have different spp, the reference is taken to
        have added as much as to an image with as many samples spread evenly. Late in a series what
        it added is not known: there are at most as many as are seen against the reference.
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
    """A rule that judges one merged image after the other."""

    #: Spp between two looks.
    step: int
    stops: Callable[[Evidence], bool]
    looks: int = 0


def whole_image_rules(view: View) -> dict[str, WholeImage]:
    """Return fresh rules by name, all but the one that ends pixels one by one."""
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
    """Let every rule end a series for itself, and hold what it left against the reference."""
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
    """Return how many pixels Cycles' rule still waits for."""
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
        """Return where it stands."""
        rule = self.rule
        return Stop(rule.mean_spp, self.ended, self.looks, seen, rule.active_pixels)
