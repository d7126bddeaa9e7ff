"""The tables of docs/science/savings.md: what each rule spends, and the noise that it leaves."""

from __future__ import annotations

import math
import statistics
from typing import TYPE_CHECKING

from bench.experiment.contenders import TARGET
from bench.experiment.spending import CYCLES_ADAPTIVE, FIXED, FIXED_SPP, RULES, Stop
from bench.experiment.tables import FALSE_STOP
from bench.experiment.truth import true_spp
from bench.support.markdown import table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bench.experiment.spending import Left, Spending


def time_ratios(spent: Spending, rule: str) -> list[float]:
    """Return a rule's machine time over that of the fixed samples, for each timed slice."""
    stop = spent.stops[rule]
    looking_s = stop.looks * statistics.median(spent.look_s[rule])
    return [(stop.spp * spp_s + looking_s) / (FIXED_SPP * spp_s) for spp_s in spent.spp_s]


def scene_tables(every: Sequence[Spending]) -> str:
    """Return a table for each scene, under its name: a row for each rule."""
    head = ["rule", "stopped at, spp", "machine time", "pixels still visibly wrong", "share"]
    parts = []
    for one in every:
        rows = [[_name(rule), *_row(one, rule)] for rule in RULES]
        rows.append([FIXED, *_fixed_row(one)])
        true = true_spp(one.measured, TARGET)
        known = f"over {one.cap / 2:,.0f}" if true is None else f"{true:,.0f}"
        about = f"Rendered to {one.cap:,} spp; {TARGET:.1%} are wrong at {known} spp."
        parts.append(f"### {one.name}\n\n{about}\n\n{table(head, rows)}")
    return "\n".join(parts)


def summary_table(every: Sequence[Spending]) -> str:
    """Return each rule's machine time over all scenes, and how often it left too much."""
    head = [
        "rule",
        "machine time, median",
        "least to most",
        "never stopped",
        f"over {TARGET:.1%} wrong",
        f"over {FALSE_STOP * TARGET:.1%} wrong",
        "most wrong",
    ]
    rows = []
    for rule in RULES:
        stops = [one.stops[rule] for one in every]
        least = [statistics.median(time_ratios(one, rule)) for one in every]
        # If the rule did not end the scene, its cost is only known to be at least this.
        most = [ratio if stop.ended else math.inf for ratio, stop in zip(least, stops, strict=True)]
        left = [one.left(rule) for one in every]
        wrong = [many.pixels / one.pixels**2 for many, one in zip(left, every, strict=True)]
        worst = max(range(len(every)), key=wrong.__getitem__)
        never = sum(not stop.ended for stop in stops)
        rows.append(
            [
                _name(rule),
                _bounds(statistics.median(least), statistics.median(most)),
                f"{min(least):.0%} to {_bounds(max(least), max(most))}",
                str(never) + (" to its last pixel" if never and rule == CYCLES_ADAPTIVE else ""),
                _over(TARGET, left, wrong),
                _over(FALSE_STOP * TARGET, left, wrong),
                f"{left[worst].how} {wrong[worst]:.2%}".strip(),
            ]
        )
    return table(head, rows)


def cost_table(every: Sequence[Spending]) -> str:
    """Return what rendering and evaluating cost, scene by scene."""
    head = ["scene", "one spp", "one evaluation of ours", "LuxCore's", "Cycles'", "other work"]
    rows = []
    for one in every:
        looks = [statistics.median(one.look_s[rule]) for rule in (RULES[0], RULES[3], RULES[5])]
        rows.append(
            [
                one.name,
                f"{statistics.median(one.spp_s) * 1000:.0f} ms",
                *(f"{seconds * 1000:.3g} ms" for seconds in looks),
                f"{one.others:.0%}",
            ]
        )
    return table(head, rows)


def _bounds(least: float, most: float) -> str:
    return f"{least:.0%}" if least == most else f"over {least:.0%}"


def _over(share: float, left: Sequence[Left], wrong: Sequence[float]) -> str:
    """Return in how many scenes more than a share is wrong, and how many are unsure."""
    over = [many.how for many, one in zip(left, wrong, strict=True) if one > share]
    unsure = over.count("at most")
    return f"{len(over) - unsure}" + (f", {unsure} unsure" if unsure else "")


def _row(spent: Spending, rule: str) -> list[str]:
    stop = spent.stops[rule]
    ratio = statistics.median(time_ratios(spent, rule))
    if rule == CYCLES_ADAPTIVE:
        words, since = f"{stop.spp:,.0f} on average", f" by {spent.cap:,}"
    else:
        words, since = ("" if stop.ended else "> ") + f"{stop.spp:,.0f}", ""
    if stop.unfinished:
        words += f" ({stop.unfinished} pixels not done{since})"
    time = f"{ratio:.0%}" if stop.ended else f"over {ratio:.0%}"
    return [words, time, *_wrong(spent, spent.left(rule))]


def _fixed_row(spent: Spending) -> list[str]:
    left = spent.left_by(Stop(spent.cap, True, 0, spent.truth[-1]))
    words = f"{FIXED_SPP:,}" + ("" if spent.cap == FIXED_SPP else f" (evaluated at {spent.cap:,})")
    return [words, "100%", *_wrong(spent, left)]


def _wrong(spent: Spending, left: Left) -> list[str]:
    share = left.pixels / spent.pixels**2
    return [f"{left.how} {left.pixels:.0f}".strip(), f"{left.how} {share:.2%}".strip()]


def _name(rule: str) -> str:
    """Return a rule's name for a document: ours are set as code."""
    first, _, rest = rule.partition(",")
    return f"`{first}`{',' if rest else ''}{rest}" if first in {"visible", "reverse"} else rule
