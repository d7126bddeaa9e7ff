"""The error of the half-buffer estimate and its forecast: `make bench-estimate`.

The noise is synthetic, so the truth is known: how many pixels visibly differ from the converged
image. For each scene and noise this is compared with the estimate, and counted are how often the
truth lies in the estimate's band, and how often the spp at which the estimate really falls to the
target lies in the forecast's band.
"""

import argparse
from dataclasses import dataclass
from typing import Any

import numpy as np

from bench.support import markdown
from bench.support.farms.synthetic_noise import Render
from bench.support.report import Figure, write_report
from plateau.farm.bundle.analytic import LIGHTS
from plateau.metric import Evidence, View
from plateau.metric.compiled import CompiledVisibleDifferences

TARGET = 0.002
#: With fewer visible pixels in all runs together, a ratio is a matter of luck.
FEW = 20
_SHARES = ("truth in the band", "forecast in its band")
#: The ratio of one spp to the one before.
GRID_STEP = 1.05
_NOTES = (
    "Ratios are of sums over the seeds, so that seeds with few visible pixels do not dominate.",
    "Bands are designed to hold nine cases of ten.",
    "A forecast is judged by the first spp on a grid of 5 % where the estimate is at its target.",
)


@dataclass
class Row:
    """Sums over the seeds, at one spp of one scene and noise."""

    truth: float = 0.0
    estimate: float = 0.0
    in_band: int = 0
    forecasts: int = 0
    forecasts_in_band: int = 0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=16, help="renders of each case")
    parser.add_argument("--size", type=int, default=96, help="pixels across and down")
    options = parser.parse_args()
    figures: list[Figure] = []
    for noise in ("Gaussian", "heavy-tailed"):
        for scene in LIGHTS:
            for spp, row in _rows(scene, noise, options.size, options.seeds).items():
                figures += _figures(f"{scene}, {noise}, {spp} spp", row, options)
    settings = {"seeds": options.seeds, "size": options.size, "level": 0.3, "target": TARGET}
    report = write_report("estimate", figures, settings=settings, notes=_NOTES)
    markdown.fill(markdown.DOCS / "stopping.md", {"estimate": table(report)})


def table(report: dict[str, Any]) -> str:
    """Return a report as Markdown: a row for each scene, noise and spp."""
    rows: dict[tuple[str, str], dict[str, float]] = {}
    for one in report["figures"]:
        case, what = one["name"].split(": ")
        scene, noise, spp = case.split(", ")
        rows.setdefault((f"{scene}, {noise}", spp.removesuffix(" spp")), {})[what] = one["value"]
    pixels = report["settings"]["seeds"] * report["settings"]["size"] ** 2
    return markdown.table(
        ["scene, noise", "spp", "truly visible", "estimate / truth", *_SHARES],
        [
            [
                *case,
                f"{row['truth']:.3g}" if row["truth"] == 0 else f"{row['truth']:.3%}",
                f"{row['estimate over truth']:.2f}" if row["truth"] * pixels >= FEW else "–",
                *(f"{row[share]:.0%}" if share in row else "–" for share in _SHARES),
            ]
            for case, row in rows.items()
        ],
    )


def _rows(scene: str, noise: str, size: int, seeds: int) -> dict[int, Row]:
    metric = CompiledVisibleDifferences(View())
    grid = sorted({2 * round(25 * GRID_STEP**k) for k in range(80)})
    shown = [spp for spp in grid if any(abs(spp - 50 * 2**k) <= 0.025 * spp for k in range(5))]
    rows = {spp: Row() for spp in shown}
    for seed in range(seeds):
        render = Render(scene, noise, 0.3, size, seed)
        truth = metric.percept(render.truth)
        reached, foretold = None, {}
        for spp, image, halves in render.images(grid):
            seen = Evidence(spp, image, halves, metric)
            estimate = seen.estimate
            assert estimate is not None  # there are halves
            if reached is None and estimate.fraction <= TARGET:
                reached = spp
            if spp in rows:
                count = metric.compare(truth, seen.percept).count
                rows[spp].truth += count
                rows[spp].estimate += estimate.pixels
                rows[spp].in_band += estimate.low_pixels <= count <= estimate.high_pixels
                ahead = seen.forecast(TARGET)
                if reached is None and ahead is not None:
                    foretold[spp] = ahead
        for spp, ahead in foretold.items():
            if reached is None or ahead.low_spp is None or ahead.high_spp is None:
                continue
            rows[spp].forecasts += 1
            # The crossing lies between the last spp of the grid and this one.
            rows[spp].forecasts_in_band += (
                ahead.low_spp <= reached and reached / GRID_STEP <= ahead.high_spp
            )
    return rows


def _figures(name: str, row: Row, options: argparse.Namespace) -> list[Figure]:
    pixels = options.seeds * options.size**2
    ratio = row.estimate / row.truth if row.truth else float(np.isclose(row.estimate, 0))
    found = [
        ("truth", row.truth / pixels, "fraction", None),
        ("estimate over truth", ratio, "ratio", "near 1"),
        ("truth in the band", row.in_band / options.seeds, "share of runs", "about 0.9"),
    ]
    if row.forecasts:
        hit = row.forecasts_in_band / row.forecasts
        found.append(("forecast in its band", hit, "share of runs", "about 0.9"))
    return [
        Figure(name=f"{name}: {what}", value=value, unit=unit, goal=goal)
        for what, value, unit, goal in found
    ]


if __name__ == "__main__":
    main()
