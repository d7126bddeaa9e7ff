"""What the two eyes say of the same images, and how far their estimate is right: `make bench-eyes`.

From recordings of slices, as those of `bench.allocation`:

- how much the estimate of `plateau.metric.quality` says is lost, in JOD, over what is lost against
  the rest of the recording, whose own noise the estimate is given too;
- at how many samples two pixels in ten thousand are visibly wrong under the paper's view, where
  the rule `visible` stops, and the quality of that image under each view;
- how many samples each view needs for 9 and for 9.5 JOD.

The last two are by the noise of the whole recording, scaled.
"""

import math
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from bench.support.recordings import PAPER, RECORDED, SCENES, parser_of, recorded, recordings_row
from bench.support.report import Table, write_report
from bench.support.truth import Truth, crossing
from plateau.metric import Half, View, Visible
from plateau.metric.compiled import CompiledVisibleDifferences
from plateau.metric.cvvdp import ColorVideoVDP, Percept
from plateau.metric.display import displayed
from plateau.metric.noise_model import noise_model
from plateau.metric.quality import BEST_JOD, QualityModel, display_of

#: The paper's screen, which the image fills, and pixel by pixel at two distances.
VIEWS: Final = {
    "the paper's view": PAPER,
    "20 pixels per degree": replace(PAPER, field_of_view_deg=None, pixels_per_degree=20.0),
    "40 pixels per degree": replace(PAPER, field_of_view_deg=None, pixels_per_degree=40.0),
}
TARGETS: Final = (9.0, 9.5)
#: Images of so many samples are judged, if the recording has four times as many.
LOOKS: Final = (100, 200, 400, 800, 1600)
#: Samples of noise over which a quality is a mean.
GROUPS: Final = (0, 4, 8)


def main() -> None:
    asked = parser_of(__doc__).parse_args()
    for name in asked.cases:
        recording = recorded(SCENES[name], asked)
        found = tables(f"{name}, {asked.pixels} px", recording, asked.slice_spp, asked.runs)
        recordings = [RECORDED, recordings_row(name, asked, asked.runs)]
        write_report(
            "eyes",
            {**found, "eyes-recordings": recordings},
            settings={},
            notes=[
                "What is lost is 10 - JOD. The truth is against the rest of the recording.",
                "Stops, and samples needed, are by samples of the recording's noise, scaled.",
            ],
            document="eyes.md",
        )


def tables(
    scene: str, recording: NDArray[np.float32], slice_spp: int, runs: int
) -> dict[str, Table]:
    """Return the tables of one recording."""
    pixels = recording.shape[1] * recording.shape[2]
    truth = Truth(CompiledVisibleDifferences(PAPER), recording, slice_spp)
    stop = truth.spp_at(Visible().target * pixels, 1000.0)
    at_stop, needs, estimated = [], [], []
    for name, view in VIEWS.items():
        lost = Lost(truth, view)
        needed = [
            crossing(lambda spp: lost.at(1000 * spp), BEST_JOD - target) * 1000  # noqa: B023
            for target in TARGETS
        ]
        at_stop.append(f"{BEST_JOD - lost.at(stop):.2f}")
        needs.append(", ".join(f"{spp:,.0f}" for spp in needed))
        both = estimates(recording, slice_spp, view, runs, needed[-1])
        estimated.append([scene, name, *map(extent, both)])
    head = ["scene", "`visible` stops at"]
    head += [f"JOD there, {view}" for view in VIEWS]
    head += [f"spp for 9 and 9.5 JOD, {view}" for view in VIEWS]
    return {
        "eyes": [head, [scene, f"{stop:,.0f}", *at_stop, *needs]],
        "eyes-estimate": [
            ["scene", "view", "lost, estimated / true", "forecast / needed for 9.5 JOD"],
            *estimated,
        ],
    }


def extent(values: list[float]) -> str:
    """Return the lowest and the highest value."""
    return f"{min(values):.2f} to {max(values):.2f}" if values else "–"


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
) -> tuple[list[float], list[float]]:
    """Return how far the estimate and the forecast are right, as means over the runs by spp."""
    metric, total = CompiledVisibleDifferences(view), len(recording)
    eye = ColorVideoVDP(display_of(view, recording.shape[2]))
    sums = recording.sum(axis=0, dtype=np.float64)
    means: tuple[list[float], list[float]] = ([], [])
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
        for values, mean in zip((ratios, forecasts), means, strict=True):
            mean += [float(np.mean(values))] if values else []
    return means


if __name__ == "__main__":
    main()
