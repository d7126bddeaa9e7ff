"""What the two eyes say of the same images, and how far their estimate is right: `make bench-eyes`.

From recordings of slices, as those of `bench.allocation`:

- how much the estimate of `plateau.metric.quality` says is lost, in JOD, over what is lost against
  the rest of the recording, whose own noise the estimate is given too;
- at how many samples two pixels in ten thousand are visibly wrong under the default view, where
  the rule `visible` stops, and the quality of that image under each view;
- how many samples each view needs for 9 and for 9.5 JOD.

The last two are by the noise of the whole recording, scaled.
"""

from __future__ import annotations

import argparse
import math
import sys
from typing import TYPE_CHECKING, Any

import numpy as np

from bench.allocating.recordings import SCENES, add_options, recorded
from bench.allocating.truth import Truth, crossing
from bench.support import markdown
from bench.support.report import Figure, last_figures, last_report, renewed, write_report
from plateau.metric import Half, View, Visible, allowed_pixels
from plateau.metric.compiled import CompiledVisibleDifferences
from plateau.metric.cvvdp import ColorVideoVDP
from plateau.metric.display import displayed
from plateau.metric.noise_model import noise_model
from plateau.metric.quality import BEST_JOD, QualityModel, display_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from plateau.metric.cvvdp import Percept

#: Pixels per degree, by the name of the view.
VIEWS = {"the default view": None, "20 pixels per degree": 20.0, "40 pixels per degree": 40.0}
TARGETS = (9.0, 9.5)
#: Images of so many samples are judged, if the recording has four times as many.
LOOKS = (100, 200, 400, 800, 1600)
#: Samples of noise over which a quality is a mean.
GROUPS = (0, 4, 8)
_RATIO, _FORECAST = "lost, estimated / true at {} spp", "forecast at {} spp / needed"
_STOP, _AT_STOP, _NEEDED = "visible stops", "quality where visible stops", "spp for {:g} JOD"
_NOTES = (
    "What is lost is 10 - JOD. The truth is against the rest of the recording.",
    "Stops, and samples needed, are by three to twelve samples of the recording's noise, scaled.",
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    add_options(parser)
    asked = parser.parse_args()
    kept = last_figures("eyes")
    settings = last_report("eyes")["settings"].get("scenes", {})
    for name in asked.cases:
        recording = recorded(SCENES[name], asked.pixels, asked.spp, asked.slice_spp, asked.data)
        scene = f"{name}, {asked.pixels} px"
        settings[scene] = {"spp": asked.slice_spp * len(recording), "slice_spp": asked.slice_spp}
        found = measured(recording, asked.slice_spp, asked.runs)
        kept = renewed(kept, scene, found)
        for one in found:
            print(scene, one.name, one.value, file=sys.stderr)
    report = write_report("eyes", kept, settings={"scenes": settings}, notes=_NOTES)
    markdown.fill(markdown.DOCS / "eyes.md", tables(report))


def measured(recording: NDArray[np.float32], slice_spp: int, runs: int) -> list[Figure]:
    """Return the figures of one recording."""
    pixels = recording.shape[1] * recording.shape[2]
    truth = Truth(CompiledVisibleDifferences(View()), recording, slice_spp)
    stop = truth.spp_at(allowed_pixels(Visible().target, pixels), 1000.0)
    found = [Figure(name=_STOP, value=stop, unit="spp")]
    for name, density in VIEWS.items():
        view = View(pixels_per_degree=density)
        lost = Lost(truth, view)
        needed = {
            target: crossing(lambda spp: lost.at(1000 * spp), BEST_JOD - target) * 1000  # noqa: B023
            for target in TARGETS
        }
        values = {_AT_STOP: BEST_JOD - lost.at(stop)}
        values |= {_NEEDED.format(target): spp for target, spp in needed.items()}
        values |= estimates(recording, slice_spp, view, runs, needed[TARGETS[-1]])
        found += [
            Figure(name=f"{name}: {what}", value=value, unit=_unit(what))
            for what, value in values.items()
        ]
    return found


class Lost:
    """What the noise of a recording takes from the quality of an image under a view."""

    def __init__(self, truth: Truth, view: View) -> None:
        self._truth, self._view = truth, view
        self._eye = ColorVideoVDP(display_of(view, truth.clean.shape[1]))
        self._clean = self._percept(truth.clean)

    def _percept(self, image: NDArray[np.float32]) -> Percept:
        return self._eye.percept(displayed(image, self._view))

    def at(self, spp: float) -> float:
        """Return what an image of this spp has lost, in JOD, as a mean over samples of noise."""
        images = (self._percept(self._truth.image(group, spp)) for group in GROUPS)
        jods = [self._eye.compare(self._clean, image).jod for image in images]
        return BEST_JOD - sum(jods) / len(jods)


def estimates(
    recording: NDArray[np.float32], slice_spp: int, view: View, runs: int, needed: float
) -> dict[str, float]:
    """Return how far the estimate and the forecast are right, as means over the runs."""
    metric, total = CompiledVisibleDifferences(view), len(recording)
    eye = ColorVideoVDP(display_of(view, recording.shape[2]))
    sums = recording.sum(axis=0, dtype=np.float64)
    found = {}
    for spp in LOOKS:
        count = spp // slice_spp
        if 4 * count > total:
            break
        ratios, forecasts = [], []
        for run in range(min(runs, total // count)):
            part = recording[run * count : (run + 1) * count].astype(np.float64)
            rest = ((sums - part.sum(axis=0)) / (total - count)).astype(np.float32)
            image = part.mean(axis=0).astype(np.float32)
            even, odd = (part[half::2].mean(axis=0).astype(np.float32) for half in (0, 1))
            halves = Half(even, spp / 2), Half(odd, spp / 2)
            noise = noise_model(metric, image, halves)
            model = QualityModel(noise, view)
            reference, test = (eye.percept(displayed(one, view)) for one in (rest, image))
            true = BEST_JOD - eye.compare(reference, test).jod
            # The reference has noise too, so the difference has more than the image.
            ratios.append((BEST_JOD - model.at(math.sqrt(total / (total - count)))) / true)
            forecast = model.forecast(TARGETS[-1], spp=spp)
            if forecast is not None and spp < needed:
                forecasts.append(forecast / needed)
        found[_RATIO.format(spp)] = float(np.mean(ratios))
        if forecasts:
            found[_FORECAST.format(spp)] = float(np.mean(forecasts))
    return found


def _unit(what: str) -> str:
    if "/" in what:
        return "ratio"
    return "JOD" if what == _AT_STOP else "spp"


def tables(report: dict[str, Any]) -> dict[str, str]:
    """Return the tables by the names of their places in the document."""
    values = {one["name"]: one["value"] for one in report["figures"]}
    scenes = report["settings"]["scenes"]

    def of(scene: str, view: str, what: str) -> list[float]:
        """Return the values at any spp."""
        start, end = what.split("{}")
        names = (f"{scene}: {view}: {start}{spp}{end}" for spp in LOOKS)
        return [values[name] for name in names if name in values]

    def extent(found: list[float]) -> str:
        return f"{min(found):.2f} to {max(found):.2f}" if found else "–"

    def needs(scene: str, view: str) -> str:
        return ", ".join(
            f"{values[f'{scene}: {view}: {_NEEDED.format(target)}']:,.0f}" for target in TARGETS
        )

    stops = [
        [
            scene,
            f"{values[f'{scene}: {_STOP}']:,.0f}",
            *(f"{values[f'{scene}: {view}: {_AT_STOP}']:.2f}" for view in VIEWS),
            *(needs(scene, view) for view in VIEWS),
        ]
        for scene in scenes
    ]
    rows = [
        [
            scene,
            view,
            extent(of(scene, view, _RATIO)),
            extent(of(scene, view, _FORECAST)),
        ]
        for scene in scenes
        for view in VIEWS
    ]
    head = ["scene", "`visible` stops at"]
    head += [f"JOD there, {view}" for view in VIEWS]
    head += [f"spp for 9 and 9.5 JOD, {view}" for view in VIEWS]
    return {
        "eyes": markdown.table(head, stops),
        "eyes-estimate": markdown.table(
            ["scene", "view", "lost, estimated / true", "forecast / needed for 9.5 JOD"], rows
        ),
    }


if __name__ == "__main__":
    main()
