"""The paper's experiment on our own scenes and our own farm: `make bench-paper`.

At 256×256 and 10,000 spp all eight take 10.5 thousand million samples and 2 GB of disk. The paper's
own size is --size 512.
"""

import statistics
import sys
import time
from collections.abc import Sequence
from typing import Final

from bench.support import series
from bench.support.report import DOCS, Table, fill, markdown, write_report
from bench.support.series import CONTENDERS, STEPS, TARGET, TARGETS, Series, Size, Stop

#: Spp that the paper renders without a rule.
PAPER_CAP: Final = 10_000
#: The spp at which the forecast is compared with the truth.
_FORECAST_AT: Final = (100, 200, 400, 800, 1600)
#: A stop further from the truth than this misses the goal.
GOAL: Final = 0.10
#: A stop with more than this many times the target still visible is a false one.
FALSE_STOP: Final = 3.0
_RULES: Final = [f"{name} @{step}" for step in STEPS for name in CONTENDERS]


def main() -> None:
    asked = series.parse(__doc__)
    for case in asked.cases:
        size = Size(asked.size, asked.cap)
        renders = series.rendered(case, size, asked.data, workers=asked.workers)
        started = time.monotonic()
        series.keep(series.measure(renders), case)
        print(f"{case.name}: judged in {time.monotonic() - started:.0f} s", file=sys.stderr)
    found = tables(series.known())
    write_report(
        "paper",
        found,
        settings={"slice_spp": series.SLICE_SPP, "steps": STEPS},
        notes=[
            f"True: at most {TARGET:.1%} of the pixels differ visibly from the reference.",
            "The reference has noise of its own, so true is later than by a converged image.",
            "Every rule judges the same slices, under the paper's view and with its defaults.",
            "No rule ends a series: each continues to the cap.",
        ],
        document="paper.md",
    )
    fill(DOCS / "stopping.md", {name: markdown(table) for name, table in found.items()})


def tables(every: Sequence[Series]) -> dict[str, Table]:
    """Return every table by the name of its place in the documents."""
    return {
        "truth": truth_table(every),
        **{f"stops-{step}": stop_table(every, step) for step in STEPS},
        "summary": summary_table(every),
        "real": estimate_table(every),
        "real-forecast": forecast_table(every),
    }


def error(one: Series, stop: Stop) -> float | None:
    """Return a stop's spp over the true one, less 1; None if either is unknown."""
    true = one.true_spp(TARGET)
    return stop.spp / true - 1 if stop.ended and true is not None else None


def truth_table(every: Sequence[Series]) -> Table:
    """Return the spp from which each image is converged, by target."""
    head = ["scene", "rendered to"]
    head += [f"{target:.2%} against the reference" for target in TARGETS]
    head += [f"{target:.2%} against the truth" for target in TARGETS]
    return [
        head,
        *(
            [
                one.name,
                f"{one.cap:,}",
                *(_spp(one.reference_spp(target), one.cap) for target in TARGETS),
                *(_spp(one.true_spp(target), one.cap / 2) for target in TARGETS),
            ]
            for one in every
        ),
    ]


def stop_table(every: Sequence[Series], step: int) -> Table:
    """Return where every contender stopped at one step, and how far that is from the truth."""

    def cell(one: Series, name: str) -> str:
        stop = one.stops[f"{name} @{step}"]
        off = error(one, stop)
        if not stop.ended:
            return f"over {one.cap:,}"
        return f"{stop.spp:,}" + ("" if off is None else f" ({off:+.0%})")

    return [
        ["scene", "true", *CONTENDERS],
        *([one.name, _true(one), *(cell(one, name) for name in CONTENDERS)] for one in every),
    ]


def summary_table(every: Sequence[Series]) -> Table:
    """Return how far off each contender was over all scenes, and what it saved."""
    table = [
        [
            *("rule @ step", "off by, median", "worst", f"within {GOAL:.0%}"),
            f"false stops (over {FALSE_STOP * TARGET:.1%} wrong)",
            *("never stopped", "samples saved, median"),
        ]
    ]
    for name in _RULES:
        stops = [one.stops[name] for one in every]
        errors = [
            off
            for one, stop in zip(every, stops, strict=True)
            if (off := error(one, stop)) is not None
        ]
        wrong = [
            left / one.pixels**2
            for one, stop in zip(every, stops, strict=True)
            if stop.ended and (left := one.truth_at(stop.spp)) is not None
        ]
        saved = statistics.median(1 - stop.spp / PAPER_CAP if stop.ended else 0 for stop in stops)
        table.append(
            [
                name.replace("@", "@ "),
                f"{statistics.median(map(abs, errors)):.0%}" if errors else "–",
                f"{max(errors, key=abs):+.0%}" if errors else "–",
                f"{sum(abs(off) <= GOAL for off in errors)} of {len(errors)}",
                f"{sum(share > FALSE_STOP * TARGET for share in wrong)}",
                f"{sum(not stop.ended for stop in stops)}",
                f"{saved:.0%}",
            ]
        )
    return table


def estimate_table(every: Sequence[Series]) -> Table:
    """Return the half-buffer estimate over the truth, by scene and spp."""

    def cell(one: Series, spp: int) -> str:
        truth, estimate = one.truth_at(spp), one.estimate.get(str(spp))
        if truth is None or estimate is None or truth < 1:
            return "–"
        inside = "" if estimate[1] <= truth <= estimate[2] else " *"
        return f"{estimate[0] / truth:.2f} of {truth / one.pixels**2:.2%}{inside}"

    head = ["scene", *(f"{spp:,} spp" for spp in series.ASKED_AT)]
    return [head, *([one.name, *(cell(one, spp) for spp in series.ASKED_AT)] for one in every)]


def forecast_table(every: Sequence[Series]) -> Table:
    """Return the forecast of the true spp over the true spp, by scene and spp."""

    def cell(one: Series, spp: int) -> str:
        true, found = one.true_spp(TARGET), one.forecast.get(str(spp))
        if found is None or true is None or spp >= true:
            return "–"
        return f"{found / true:.2f}"

    head = ["scene", "true", *(f"at {spp:,} spp" for spp in _FORECAST_AT)]
    return [
        head,
        *([one.name, _true(one), *(cell(one, spp) for spp in _FORECAST_AT)] for one in every),
    ]


def _true(one: Series) -> str:
    return _spp(one.true_spp(TARGET), one.cap / 2)


def _spp(spp: float | None, most: float) -> str:
    return f"over {most:,.0f}" if spp is None else f"{spp:,.0f}"


if __name__ == "__main__":
    main()
