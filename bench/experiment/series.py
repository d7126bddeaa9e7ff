"""One series of slices, judged from end to end: what every rule says, and what is true.

Nothing here stops: every rule goes on to the cap, so that its whole curve can be drawn.
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
#: Where forecasts are made and other metrics asked, in spp.
ASKED_AT = (50, 100, 200, 400, 800, 1600, 3200, 6400)


@dataclass
class Curve:
    """What one rule said, evaluation after evaluation."""

    spp: list[int] = field(default_factory=list)
    #: The number that the rule watches; None where it had none yet.
    value: list[float | None] = field(default_factory=list)
    #: Pixels that it found visible, where it counts any.
    visible: list[float | None] = field(default_factory=list)
    #: Where it would have stopped; None where it would not have.
    stop: int | None = None


@dataclass
class Measured:
    """What one series has to tell."""

    name: str
    pixels: int
    cap: int
    #: Spp at which the merged image was looked at.
    spp: list[int] = field(default_factory=list)
    #: D(independent reference, I_n), in pixels.
    truth: list[int] = field(default_factory=list)
    #: The half-buffer estimate with its band, in pixels; None while there are no two halves.
    estimate: list[list[float] | None] = field(default_factory=list)
    #: The forecast of the spp at which 0.1 % are left, with its band, at `ASKED_AT`; None where it
    #: was out of reach, or there were no two halves.
    forecast: list[list[int] | None] = field(default_factory=list)
    #: What other metrics said at `ASKED_AT`, by name, where they are installed.
    opinions: dict[str, list[float]] = field(default_factory=dict)
    #: By contender and step: ``reverse @100``.
    curves: dict[str, Curve] = field(default_factory=dict)

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
    """Return the merge after every slice; the same one each time, a slice further."""
    merge = Merge(slice_spp=SLICE_SPP)
    for path in sorted(renders.slices.glob("*.exr")):
        merge.add(decode_partial(path.read_bytes()).pixels)
        yield merge


def evidence(merge: Merge, metric: CompiledVisibleDifferences) -> Evidence:
    """Return what a rule is shown of a merge."""
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
