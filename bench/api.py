"""The API under load, on a machine that renders meanwhile: `make bench-api`.

`plateau up` runs with all its parts: embedded Redis, API, monitor, and a worker that renders on
every core. In each round the farm is first idle (its job is paused), then renders, then renders
while hundreds watch the job's events. Each phase makes the same requests: a job, pages of a list of
thousands, new jobs. In the same phase a bare Starlette app on the same server
(`bench.support.bare.app`) answers such requests with the same bytes: the ratio is Plateau's own
cost.
"""

from __future__ import annotations

import argparse
import statistics
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from bench.support import markdown
from bench.support.load.service_load import PHASES, Found, Plan, measure
from bench.support.report import Figure, figure, others_figure, p99, write_report

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

_BARE = "a bare Starlette app that answers the same bytes"
_AT_ONCE = "POSTs of new scenes by several at once"
#: The bare app's request for each kind of request.
_COMPARED = {
    "GET a job": "GET a job's bytes, bare",
    "page: ": "page, bare",
    "POST ": "POST, bare",
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for name, value in asdict(Plan()).items():
        option = f"--{name.replace('_', '-')}"
        parser.add_argument(option, type=type(value), default=value, help=f"{value} if not given")
    plan = Plan(**vars(parser.parse_args()))
    report = write_report(
        "api",
        figures(measure(plan)),
        settings=asdict(plan),
        notes=[
            "Latencies are a client's; GETs count from the moment at which they were due.",
            "Farm, bare app and clients share one machine.",
            "Each round has its own median, p99 and slowest; a figure is the median of its rounds.",
            "A point's way goes from its time in Redis to its arrival at the last watcher.",
            "The listed jobs have ended; one in 200 has failed, and is in the requested batch.",
            "A POST of a new scene is answered when its blob and its job are on disk.",
            "If other work had a share of the cores, it causes most of the spread.",
        ],
    )
    markdown.fill(markdown.DOCS / "performance.md", tables(report))


def figures(found: Found) -> list[Figure]:
    """Return the figures: of each round its median, its 99th percentile and its slowest."""
    return [
        *(one for phase in PHASES for one in _latencies(phase, found)),
        *_watching(found),
        others_figure(found.others),
    ]


def _latencies(phase: str, found: Found) -> list[Figure]:
    rounds = found.latencies[phase]
    made = []
    for name, ones in rounds.items():
        wanted = "under 100 ms" if name == "GET a job" else None
        for words, value in _STATISTICS.items():
            goal = wanted if words == "p99" else None
            values = [1000 * value(one) for one in ones]
            made.append(figure(f"{phase}: {name}: {words}", values, "ms", goal=goal))
        bare = next((bare for start, bare in _COMPARED.items() if name.startswith(start)), None)
        if bare is not None and bare != name:
            pairs = zip(ones, rounds[bare], strict=True)
            ratios = [statistics.median(ours) / statistics.median(theirs) for ours, theirs in pairs]
            made.append(figure(f"{phase}: {name}: ratio", ratios, "ratio", compared_with=_BARE))
    made.append(figure(f"{phase}: {_AT_ONCE}", found.rates[phase], "1/s"))
    return made


def _watching(found: Found) -> list[Figure]:
    name = "a point's way to the last watcher"
    values = {words: [1000 * one(r) for r in found.delays] for words, one in _STATISTICS.items()}
    bare = [statistics.median(one) for one in found.bare_delays]
    ratios = [statistics.median(one) / b for one, b in zip(found.delays, bare, strict=True)]
    return [
        figure(f"{name}: median", values["median"], "ms"),
        figure(f"{name}: slowest", values["slowest"], "ms", goal="under 1000 ms"),
        figure(f"{name}: ratio", ratios, "ratio", compared_with=_BARE),
        figure("points watched in a round", [len(one) for one in found.delays], "points"),
    ]


_STATISTICS: dict[str, Callable[[Sequence[float]], float]] = {
    "median": statistics.median,
    "p99": p99,
    "slowest": max,
}


def tables(report: dict[str, Any]) -> dict[str, str]:
    """Return a report as Markdown: the machine, GETs, pages, POSTs, watchers."""
    found = {one["name"]: one["value"] for one in report["figures"]}
    names = [name.split(": ", 1)[1].rsplit(": ", 1)[0] for name in found if ": median" in name]
    rows = list(dict.fromkeys(names))

    def cell(phase: str, name: str, words: Sequence[str]) -> str:
        times = " / ".join(f"{found[f'{phase}: {name}: {one}']:.3g}" for one in words)
        ratio = found.get(f"{phase}: {name}: ratio")
        return times if ratio is None else f"{times} ({ratio:.2g})"

    def of(start: tuple[str, ...], words: Sequence[str], head: str) -> str:
        chosen = [row for row in rows if row.startswith(start)]
        return markdown.table(
            [head, *PHASES],
            [[row, *(cell(phase, row, words) for phase in PHASES)] for row in chosen],
        )

    way = "a point's way to the last watcher"
    return {
        "api-machine": markdown.machine(report, ("jobs", "watchers", "rounds")),
        "api-watchers": markdown.table(
            ["", "median / slowest, ms"],
            [
                [way, " / ".join(f"{found[f'{way}: {one}']:.3g}" for one in ("median", "slowest"))],
                [f"its median, compared with {_BARE}", f"{found[f'{way}: ratio']:.2g}"],
            ],
        ),
        "api-gets": of(("GET",), ("median", "p99", "slowest"), "median / p99 / slowest, ms"),
        "api-pages": of(("page",), ("median", "slowest"), "median / slowest, ms"),
        "api-posts": of(("POST",), ("median", "slowest"), "median / slowest, ms")
        + f"| {_AT_ONCE}, in a second | "
        + " | ".join(f"{found[f'{phase}: {_AT_ONCE}']:.0f}" for phase in PHASES)
        + " |\n",
    }


if __name__ == "__main__":
    main()
