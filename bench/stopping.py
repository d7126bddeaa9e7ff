"""When each rule stops, on noise whose truth is known: `make bench-stopping`.

Three studies vary the step, the image's size and the level of the noise. Measured are, for every
rule over many seeds: its stop relative to the spp at which the truth falls to the target (1 is on
time, below is early), the share of pixels still visibly wrong then, and how often that was a false
stop.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from bench.support import markdown, report
from bench.support.farms.synthetic_noise import Render
from bench.support.report import Figure, Spread, write_report
from plateau.metric import Evidence, View, create_rule
from plateau.metric.compiled import CompiledVisibleDifferences
from plateau.metric.estimate import allowed_pixels
from plateau.worker.renderers.analytic.picture import (
    FIREFLY_BRIGHTNESS,
    FIREFLY_PROBABILITY,
    GAMMA_SHAPE,
)

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from plateau.metric import Rule

#: The rules in the order of the paper, with their defaults; `fixed` does not look at the image.
JUDGED = ("successive", "multiple", "reverse", "myszkowski", "visible")
#: On time means: no more than this share of the pixels differs visibly from the truth.
TARGET = 0.0002
#: A stop with a larger share than this is a false one.
FALSE = 0.001
#: A rule that has not stopped by this multiple of the spp on time never stops.
CAP = 12.0

_NOTES = (
    "Spreads are from 5 to 95 % of the runs.",
    f"On time is where {TARGET:.2%} of the pixels visibly differ from the truth, in the median run",
    f"A rule that has not stopped by {CAP:g} times that spp counts as never, and not in lateness.",
    "Every rule has its default parameters and judges at the default view, step after step.",
    "A larger image fills the same angle, so its noise is finer.",
    "The noise is independent from pixel to pixel, and no light path is found only late.",
)


@dataclass(frozen=True, kw_only=True)
class Case:
    """One kind of render, judged at one step."""

    scene: str = "checks"
    noise: str = "Gaussian"
    level: float = 0.3
    size: int = 96
    step: int = 100


@dataclass(frozen=True)
class Stop:
    """Where a rule stopped."""

    spp: int
    wrong: float  #: share of the pixels that differed visibly from the truth
    lateness: float  #: `spp` over the spp on time


@dataclass(frozen=True)
class Outcome:
    """The stops of a rule in one case, over all seeds."""

    case: Case
    rule: str
    stops: list[Stop]
    never: int  #: how often it had not stopped by the cap

    @property
    def false(self) -> float:
        """Share of the seeds in which it stopped on an image still visibly wrong."""
        return sum(stop.wrong > FALSE for stop in self.stops) / (len(self.stops) + self.never)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=16, help="renders of each case")
    parser.add_argument("--quick", action="store_true", help="small images and few seeds")
    options = parser.parse_args()
    run(seeds=3 if options.quick else options.seeds, quick=options.quick)


def run(*, seeds: int, quick: bool) -> list[Outcome]:
    """Run the three studies, write their report and their pictures, and return the outcomes."""
    base = Case(size=48) if quick else Case()
    scenes = [base] if quick else [base, replace(base, scene="ramp"), heavy_tailed(base)]
    studies = {
        "step": [replace(one, step=step) for one in scenes for step in (25, 50, 100, 200)],
        "size": [replace(one, size=size) for one in scenes for size in _sizes(base.size)],
        "level": [
            replace(one, level=base.level * factor) for one in scenes for factor in (0.5, 1, 2)
        ],
    }
    known: dict[Case, list[Outcome]] = {}
    for case in dict.fromkeys(case for cases in studies.values() for case in cases):
        known[case] = outcomes(case, seeds)
        print(_line(case, known[case]), flush=True)
    everything = [outcome for case in known.values() for outcome in case]

    name = "stopping-quick" if quick else "stopping"
    written = write_report(
        name,
        [one for outcome in everything for one in _figures(outcome)],
        settings={
            "seeds": seeds,
            "target": TARGET,
            "false_stop_above": FALSE,
            "cap": CAP,
            "base": asdict(base),
            "gamma_shape": GAMMA_SHAPE,
            "firefly": [FIREFLY_PROBABILITY, FIREFLY_BRIGHTNESS],
        },
        notes=_NOTES,
    )
    if not quick:
        markdown.fill(markdown.DOCS / "stopping.md", {"rules": table(written)})
    for study, cases in studies.items():
        plot(study, [known[case] for case in cases], report.RESULTS / f"{name}-{study}.png")
    return everything


def table(report: dict[str, Any]) -> str:
    """Return a report as Markdown: a row for each case, a column for each rule."""
    rows: dict[str, dict[str, dict[str, dict[str, Any]]]] = {}
    for one in report["figures"]:
        rule, case, what = one["name"].split(": ")
        rows.setdefault(case, {}).setdefault(rule, {})[what] = one
    return markdown.table(
        ["case", *(f"`{rule}`" for rule in JUDGED)],
        [[case, *(_cell(found[rule]) for rule in JUDGED)] for case, found in rows.items()],
    )


def _cell(found: dict[str, dict[str, Any]]) -> str:
    """Return the lateness with its spread, and how often the stop was false or missing."""
    words = []
    if "lateness" in found:
        late, spread = found["lateness"]["value"], found["lateness"]["spread"]
        words.append(f"{late:.2f} ({spread['lowest']:.2f}–{spread['highest']:.2f})")
    for what, word in (("false stops", "false"), ("never stopped", "never")):
        if found[what]["value"]:
            words.append(f"{found[what]['value']:.0%} {word}")
    return ", ".join(words)


def heavy_tailed(case: Case) -> Case:
    """Return the same case with noise of heavy tails."""
    return replace(case, noise="heavy-tailed")


def _sizes(base: int) -> tuple[int, ...]:
    return base // 2, base, base * 2


def outcomes(case: Case, seeds: int) -> list[Outcome]:
    """Return the outcome of every rule in this case."""
    stops: dict[str, list[Stop]] = {name: [] for name in JUDGED}
    on_time = max(float(np.median([_on_time(case, seed) for seed in range(seeds)])), 1.0)
    for seed in range(seeds):
        for name, (spp, wrong) in _judge(case, seed, round(CAP * on_time)).items():
            stops[name].append(Stop(spp, wrong, spp / on_time))
    return [Outcome(case, name, stops[name], seeds - len(stops[name])) for name in JUDGED]


def _on_time(case: Case, seed: int) -> float:
    """Return the spp at which the truth falls to the target, within 5 %."""
    render = Render(case.scene, case.noise, case.level, case.size, seed)
    metric = CompiledVisibleDifferences(View())
    truth = metric.percept(render.truth)
    allowed = allowed_pixels(TARGET, case.size**2)

    def is_wrong(spp: int) -> bool:
        # Each call renders anew, so the result of one seed is one draw.
        image = next(render.images([spp]))[1]
        return metric.compare(truth, metric.percept(image)).count > allowed

    low = high = 16
    while is_wrong(high):
        low, high = high, high * 2
    while high > 1.05 * low:
        middle = round(math.sqrt(low * high)) // 2 * 2
        if middle in {low, high}:
            break
        low, high = (middle, high) if is_wrong(middle) else (low, middle)
    return math.sqrt(low * high)


def _judge(case: Case, seed: int, cap: int) -> dict[str, tuple[int, float]]:
    """Return the spp at which each rule stopped and the share of pixels still wrong then."""
    metric = CompiledVisibleDifferences(View())
    render = Render(case.scene, case.noise, case.level, case.size, seed)
    truth = metric.percept(render.truth)
    rules: dict[str, Rule] = {name: create_rule(name) for name in JUDGED}
    stops: dict[str, tuple[int, float]] = {}
    for spp, image, halves in render.images(list(range(case.step, cap + case.step, case.step))):
        evidence = Evidence(spp, image, halves, metric)
        stopped = [name for name, rule in rules.items() if rule.judge(evidence).stop]
        for name in stopped:
            stops[name] = spp, metric.compare(truth, evidence.percept).fraction
            del rules[name]
        if not rules:
            break
    return stops


def _figures(outcome: Outcome) -> list[Figure]:
    case, name = outcome.case, outcome.rule
    about = (
        f"{name}: {case.scene}, {case.noise}, level {case.level:g}, {case.size}², step {case.step}"
    )
    figures = [
        Figure(name=f"{about}: false stops", value=round(outcome.false, 4), unit="share of runs"),
        Figure(
            name=f"{about}: never stopped",
            value=outcome.never / (len(outcome.stops) + outcome.never),
            unit="share of runs",
        ),
    ]
    if outcome.stops:
        figures += [
            _spread(f"{about}: stop", [stop.spp for stop in outcome.stops], "spp"),
            _spread(f"{about}: lateness", [stop.lateness for stop in outcome.stops], "ratio"),
            _spread(f"{about}: still wrong", [stop.wrong for stop in outcome.stops], "fraction"),
        ]
    return figures


def _spread(name: str, values: Sequence[float], unit: str) -> Figure:
    low, middle, high = (float(f"{v:.4g}") for v in np.quantile(values, (0.05, 0.5, 0.95)))
    spread = Spread(lowest=low, highest=high, runs=len(values))
    return Figure(name=name, value=middle, unit=unit, spread=spread)


def _line(case: Case, found: list[Outcome]) -> str:
    words = [
        f"{one.rule} {np.median([stop.lateness for stop in one.stops]):.2f}"
        if one.stops
        else f"{one.rule} never"
        for one in found
    ]
    return f"{case}: " + ", ".join(words)


def plot(study: str, found: list[list[Outcome]], path: Path) -> None:
    """Write a picture of the lateness of every rule over the study's variable."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure as Picture

    kinds = list(dict.fromkeys((one[0].case.scene, one[0].case.noise) for one in found))
    picture = Picture(figsize=(4.2 * len(kinds) + 1, 4), layout="constrained")
    FigureCanvasAgg(picture)
    for axes, kind in zip(
        picture.subplots(1, len(kinds), sharey=True, squeeze=False)[0], kinds, strict=True
    ):
        cases = [one for one in found if (one[0].case.scene, one[0].case.noise) == kind]
        for number, rule in enumerate(JUDGED):
            drawn = [(one[number].case, one[number].stops) for one in cases if one[number].stops]
            x = np.array([getattr(case, study) for case, _ in drawn], dtype=float)
            low, middle, high = np.array(
                [np.quantile([s.lateness for s in stops], (0.05, 0.5, 0.95)) for _, stops in drawn]
            ).T.reshape(3, -1)
            axes.errorbar(
                x * 1.03 ** (number - 2), middle, (middle - low, high - middle),
                marker="o", markersize=4, capsize=2, linewidth=1.2, label=rule,
            )  # fmt: skip
        axes.axhline(1, color="#5a5a5a", linewidth=1, linestyle=(0, (4, 3)))
        axes.set_xscale("log")
        axes.set_yscale("log")
        ticks = sorted({getattr(one[0].case, study) for one in cases})
        axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks], minor=False)
        axes.minorticks_off()
        axes.set_xlabel({"step": "step (spp)", "size": "pixels across", "level": "noise"}[study])
        axes.set_title(f"{kind[0]}, {kind[1]}", fontsize=10)
        axes.grid(visible=True, color="#e3e3e3", linewidth=0.8)
    picture.axes[0].set_ylabel("stop over the spp that are on time")
    picture.axes[-1].legend(fontsize=8)
    picture.savefig(path, dpi=110)


if __name__ == "__main__":
    main()
