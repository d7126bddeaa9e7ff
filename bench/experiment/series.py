"""One series of slices, judged from end to end: the value of every rule, and the truth.

No rule stops a series here: each continues to the cap, so that its whole curve can be drawn.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

from bench.experiment.contenders import TARGET, contenders
from bench.experiment.opinions import opinions
from bench.experiment.renders import SLICE_SPP
from plateau.farm.images.exr import decode_image, decode_partial
from plateau.metric import Evidence, Half, View
from plateau.metric.compiled import CompiledVisibleDifferences
from plateau.service.judging.merge import Merge

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from bench.experiment.renders import Rendered
    from plateau.metric import Rule

#: The paper's two steps, in spp.
STEPS = (50, 100)
#: The spp at which forecasts are made and other metrics are asked.
ASKED_AT = (50, 100, 200, 400, 800, 1600, 3200, 6400)


@dataclass
class Curve:
    """The verdicts of one rule, evaluation by evaluation."""

    spp: list[int] = field(default_factory=list)
    value: list[float | None] = field(default_factory=list)  #: None while it has none
    visible: list[float | None] = field(default_factory=list)  #: pixels; None if it counts none
    stop: int | None = None  #: spp; None if it never stopped


@dataclass
class Measured:
    """The results of one series."""

    name: str
    pixels: int
    cap: int
    spp: list[int] = field(default_factory=list)  #: of each evaluation
    truth: list[int] = field(default_factory=list)  #: D(independent reference, I_n), in pixels
    #: The half-buffer estimate with its band, in pixels; None without two halves.
    estimate: list[list[float] | None] = field(default_factory=list)
    #: The forecast of the spp at which 0.1 % are left, with its band, at `ASKED_AT`; None if it is
    #: out of reach or without two halves.
    forecast: list[list[int] | None] = field(default_factory=list)
    opinions: dict[str, list[float]] = field(default_factory=dict)  #: by metric, at `ASKED_AT`
    curves: dict[str, Curve] = field(default_factory=dict)  #: by rule and step: ``reverse @100``

    def write(self, path: Path) -> None:
        """Write it as JSON."""
        path.write_text(json.dumps(asdict(self)))

    @classmethod
    def read(cls, path: Path) -> Measured:
        """Return what `write` wrote."""
        known: dict[str, Any] = json.loads(path.read_text())
        known["curves"] = {name: Curve(**curve) for name, curve in known["curves"].items()}
        return cls(**known)


def merges(renders: Rendered) -> Iterator[Merge]:
    """Yield the merge after every slice: always the same object, with one slice more."""
    merge = Merge(slice_spp=SLICE_SPP)
    for path in sorted(renders.slices.glob("*.exr")):
        merge.add(decode_partial(path.read_bytes()).pixels)
        yield merge


def evidence(merge: Merge, metric: CompiledVisibleDifferences) -> Evidence:
    """Return the evidence of a merge for the rules."""
    halves = merge.halves()
    return Evidence(
        spp=merge.spp,
        image=merge.image(),
        halves=None if halves is None else (Half(*halves[0]), Half(*halves[1])),
        metric=metric,
    )


def measure(renders: Rendered) -> Measured:
    """Judge a series from its first slice to its last."""
    metric = CompiledVisibleDifferences(View())
    converged = decode_image(renders.reference.read_bytes())
    reference = metric.percept(converged)
    measured = Measured(renders.case.name, renders.size.pixels, renders.size.cap)
    rules: dict[int, dict[str, Rule]] = {step: contenders() for step in STEPS}
    for merge in merges(renders):
        seen = evidence(merge, metric)
        estimate = seen.estimate
        measured.spp.append(seen.spp)
        measured.truth.append(metric.compare(reference, seen.percept).count)
        measured.estimate.append(
            None if estimate is None
            else [estimate.pixels, estimate.low_pixels, estimate.high_pixels]
        )  # fmt: skip
        if seen.spp in ASKED_AT:
            measured.forecast.append(_forecast(seen))
            for name, value in opinions(converged, seen.image, metric.view).items():
                measured.opinions.setdefault(name, []).append(value)
        for step, judged in rules.items():
            if seen.spp % step == 0:
                for name, rule in judged.items():
                    curve = measured.curves.setdefault(f"{name} @{step}", Curve())
                    _add(curve, rule, seen)
    return measured


def _forecast(seen: Evidence) -> list[int] | None:
    ahead = seen.forecast(TARGET)
    if ahead is None or ahead.spp is None or ahead.low_spp is None or ahead.high_spp is None:
        return None
    return [ahead.spp, ahead.low_spp, ahead.high_spp]


def _add(curve: Curve, rule: Rule, seen: Evidence) -> None:
    verdict = rule.judge(seen)
    curve.spp.append(seen.spp)
    curve.value.append(verdict.value)
    curve.visible.append(verdict.numbers.get("visible_pixels"))
    if verdict.stop and curve.stop is None:
        curve.stop = seen.spp
