"""The paper's experiment on our own farm: a series of slices of a scene, judged by every rule.

The farm renders each scene as a job of the whole cap that keeps its slices, and an independent
reference of as many samples. These stay in a folder, so that a stopped run can continue. Every rule
judges the same slices, at the default view, and none ends the series.

The reference R_N has noise of its own: D(R_N, I_m) sees as much noise as D(truth, I_n) would, where
1/n = 1/m + 1/N. So an image reaches a target against the reference later than against the converged
image; `Series.true_spp` corrects for that.
"""

import argparse
import json
import shutil
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np

from bench import ROOT
from bench.support.other_rules import CyclesAdaptive, CyclesThreshold, LuxCoreHalt
from bench.support.processes import render
from bench.support.recordings import PAPER, Case, cases
from bench.support.report import RESULTS
from plateau import scenes
from plateau.farm.images.exr import Pixels, decode_image, decode_partial
from plateau.metric import Evidence, Rule, View, create_rule
from plateau.metric.compiled import CompiledVisibleDifferences
from plateau.picture.merge import Merge

#: Spp of one slice, the smallest step at which a series can be judged.
SLICE_SPP: Final = 50
#: The paper's two steps, in spp.
STEPS: Final = (50, 100)
#: The share of pixels still visibly wrong at which a rule should stop.
TARGET: Final = 0.001
#: Shares of the pixels that may differ visibly.
TARGETS: Final = (0.01, TARGET, 0.0001)
#: The spp at which estimates and forecasts are compared with the truth.
ASKED_AT: Final = (100, 200, 400, 800, 1600, 3200)
#: Our rules, with the paper's parameters if it gives any.
CONTENDERS: Final[dict[str, Callable[[], Rule]]] = {
    "successive": partial(create_rule, "successive"),
    "multiple, window 5": partial(create_rule, "multiple", window=5),
    "multiple, window 8": partial(create_rule, "multiple", window=8),
    "reverse": partial(create_rule, "reverse"),
    "myszkowski": partial(create_rule, "myszkowski"),
    "visible": partial(create_rule, "visible"),
    "visible, 0.1 %": partial(create_rule, "visible", target=TARGET),
}
CYCLES, CYCLES_ADAPTIVE = "Cycles, whole image", "Cycles, pixel by pixel"
_KINDS: Final = ("series", "reference")


@dataclass(frozen=True)
class Size:
    """How large the experiment is."""

    pixels: int  #: across and down
    cap: int  #: spp of every series and every reference


@dataclass(frozen=True)
class Rendered:
    """The renders of one scene."""

    case: Case
    size: Size
    slices: Path  #: a folder that `plateau judge` can read
    reference: Path  #: an EXR

    @property
    def parameters(self) -> dict[str, str]:
        """Values of the scene's ``$parameters``."""
        pixels = str(self.size.pixels)
        return {"width": pixels, "height": pixels, "intensity": f"{self.case.intensity:g}"}


@dataclass(frozen=True)
class Stop:
    """Where one rule ended one series."""

    spp: float  #: mean of the pixels; the whole cap if the rule did not end the series
    ended: bool  #: whether the rule ended the series
    looks: int  #: evaluations by the rule
    seen: int  #: D(independent reference, image) then, in pixels


@dataclass
class Series:
    """The results of one scene."""

    name: str
    pixels: int
    cap: int
    truth: list[int] = field(default_factory=list)  #: D(reference, I_n) after every slice
    #: By spp: the half-buffer estimate with its band, in pixels.
    estimate: dict[str, list[float]] = field(default_factory=dict)
    #: By spp: the forecast of the spp at which 0.1 % are left.
    forecast: dict[str, int] = field(default_factory=dict)
    #: By rule, and ours by step: ``reverse @100``.
    stops: dict[str, Stop] = field(default_factory=dict)
    spp_s: list[float] = field(default_factory=list)  #: core seconds of one spp, slice by slice
    look_s: dict[str, list[float]] = field(default_factory=dict)  #: of an evaluation, by rule
    others: float = 0.0  #: other work's share of the cores while slices were timed

    @property
    def spp(self) -> list[int]:
        """The spp after every slice."""
        return [SLICE_SPP * number for number in range(1, len(self.truth) + 1)]

    def reference_spp(self, target: float) -> int | None:
        """Return the spp from which on D(R_N, I_n) stays under a target; None if it never does."""
        allowed = target * self.pixels**2
        counts = list(zip(self.spp, self.truth, strict=True))
        last_above = max((spp for spp, count in counts if count > allowed), default=0)
        return next((spp for spp in self.spp if spp > last_above), None)

    def true_spp(self, target: float) -> float | None:
        """Return `reference_spp` without the noise of the reference: that of D(truth, I_n)."""
        spp = self.reference_spp(target)
        return None if spp is None else 1 / (1 / spp + 1 / self.cap)

    def truth_at(self, spp: float) -> float | None:
        """Return D(truth, I_n) at `spp`, in pixels; None if the series is too short for that."""
        if spp >= self.cap:
            return None
        seen = 1 / (1 / spp - 1 / self.cap)
        if not self.spp[0] <= seen <= self.spp[-1]:
            return None
        return float(np.interp(np.log(seen), np.log(self.spp), self.truth))


def parse(description: str | None) -> argparse.Namespace:
    """Parse the command line of a benchmark that works on these renders."""
    parser = argparse.ArgumentParser(description=(description or "").splitlines()[0])
    parser.add_argument("--size", type=int, default=256, help="pixels across and down (256)")
    parser.add_argument("--cap", type=int, default=10_000, help="spp of a new series (10,000)")
    parser.add_argument("--scenes", nargs="+", choices=scenes.NAMES, default=scenes.NAMES)
    parser.add_argument("--workers", type=int, default=1, help="worker processes (1)")
    parser.add_argument("--data", type=Path, default=ROOT / "paper-data", help="folder of renders")
    asked = parser.parse_args()
    if asked.cap % max(STEPS):
        parser.error(f"--cap must be a multiple of {max(STEPS)}")
    asked.cases = cases(tuple(asked.scenes))
    return asked


def known() -> list[Series]:
    """Return every series that the results hold, in the order of the paper's tables."""
    found = []
    for path in sorted((RESULTS / "series").glob("*.json")):
        about: dict[str, Any] = json.loads(path.read_text())
        about["stops"] = {rule: Stop(**stop) for rule, stop in about["stops"].items()}
        found.append(Series(**about))
    return found


def keep(one: Series, case: Case) -> None:
    """Write a series into the results."""
    (RESULTS / "series").mkdir(parents=True, exist_ok=True)
    parts = (f"{json.dumps(name)}: {json.dumps(value)}" for name, value in asdict(one).items())
    text = "{\n  " + ",\n  ".join(parts) + "\n}\n"
    (RESULTS / "series" / f"{case.slug}.json").write_text(text)


def rendered(case: Case, size: Size, data: Path, *, workers: int) -> Rendered:
    """Return the renders of a scene; make those that the folder does not have yet."""
    series, reference = (data / f"{case.slug}-{size.pixels}-{size.cap}-{kind}" for kind in _KINDS)
    one = Rendered(case, size, series / "slices", reference / "image.exr")
    for out, seed in zip((series, reference), case.seeds, strict=True):
        if not out.exists():
            _render(one, out, seed, workers)
    return one


def _render(one: Rendered, out: Path, seed: int, workers: int) -> None:
    unfinished, cap = out.with_name(f"{out.name}.part"), one.size.cap
    shutil.rmtree(unfinished, ignore_errors=True)
    options: dict[str, object] = {
        "--rule": "fixed",
        "--spp": cap,
        "--max-spp": cap,
        # One that divides the cap: these jobs need no curve.
        "--step": next(step for step in (1000, 500, 100, SLICE_SPP) if cap % step == 0),
        "--slice-spp": SLICE_SPP,
        "--seed": seed,
        "--workers": workers,
    }
    if out.name.endswith("series"):
        options["--keep-slices"] = True
    started = time.monotonic()
    scene = scenes.FOLDER / one.case.family
    render(scene, unfinished, parameters=one.parameters, options=options)
    print(f"{out.name}: rendered in {time.monotonic() - started:.0f} s", file=sys.stderr)
    unfinished.rename(out)


def evidence(merge: Merge, metric: CompiledVisibleDifferences) -> Evidence:
    """Return the evidence of a merge for the rules."""
    return Evidence(
        spp=merge.spp,
        image=merge.image(),
        halves=merge.halves(),
        metric=metric,
    )


def whole_image_rules(view: View) -> dict[str, tuple[int, Callable[[Evidence], bool]]]:
    """Return new rules that judge the merged image as a whole, each with its step."""

    def by_verdict(rule: Rule) -> Callable[[Evidence], bool]:
        return lambda seen: rule.judge(seen).stop

    def by_change(rule: LuxCoreHalt) -> Callable[[Evidence], bool]:
        return lambda seen: rule.stops(seen.spp, seen.image)

    def by_error(seen: Evidence) -> bool:
        assert seen.halves is not None
        return CyclesThreshold().stops(seen.spp, seen.image, seen.halves[0].mean)

    rules: dict[str, tuple[int, Callable[[Evidence], bool]]] = {
        f"{name} @{step}": (step, by_verdict(create()))
        for step in STEPS
        for name, create in CONTENDERS.items()
    }
    for step in STEPS:  # its own 64 are no whole number of slices
        rules[f"LuxCore, every {step} spp"] = step, by_change(LuxCoreHalt(view))
    # A is exactly half of the samples after each pair of slices.
    rules[CYCLES] = 2 * SLICE_SPP, by_error
    return rules


def measure(renders: Rendered) -> Series:
    """Judge a series from its first slice to its last."""
    metric = CompiledVisibleDifferences(PAPER)
    reference = metric.percept(decode_image(renders.reference.read_bytes()))
    found = Series(renders.case.name, renders.size.pixels, renders.size.cap)
    rules, adaptive = whole_image_rules(metric.view), CyclesAdaptive()
    looks = dict.fromkeys((*rules, CYCLES_ADAPTIVE), 0)
    merge, before = Merge(slice_spp=SLICE_SPP), None
    ended = False
    for path in sorted(renders.slices.glob("*.exr")):
        film: Pixels = decode_partial(path.read_bytes()).pixels
        merge.add(film)
        seen = evidence(merge, metric)
        found.truth.append(metric.compare(reference, seen.percept).count)
        if seen.spp in ASKED_AT:
            _look_ahead(found, seen)
        for name, (step, stops) in rules.items():
            if name not in found.stops and seen.spp % step == 0:
                looks[name] += 1
                if stops(seen):
                    found.stops[name] = Stop(seen.spp, True, looks[name], found.truth[-1])
        if before is not None and not ended:
            looks[CYCLES_ADAPTIVE] += 1
            ended = adaptive.add(before, film, 2 * SLICE_SPP)
        before = film if before is None else None
    for name in rules.keys() - found.stops.keys():
        found.stops[name] = Stop(merge.spp, False, looks[name], found.truth[-1])
    left = metric.compare(reference, metric.percept(adaptive.image)).count
    found.stops[CYCLES_ADAPTIVE] = Stop(adaptive.mean_spp, ended, looks[CYCLES_ADAPTIVE], left)
    return found


def _look_ahead(found: Series, seen: Evidence) -> None:
    estimate, ahead, spp = seen.estimate, seen.forecast(TARGET), str(seen.spp)
    if estimate is not None:
        found.estimate[spp] = [estimate.pixels, estimate.low_pixels, estimate.high_pixels]
    if ahead is not None:
        found.forecast[spp] = ahead
