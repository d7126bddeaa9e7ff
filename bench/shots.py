"""The quality of shots: the estimate against the truth, and frames alone: `make bench-shots`.

Mitsuba renders three shots of a room, in which the camera, a ball or the lamp moves, at 256×144 and
24 frames per second. Each frame has slices with seeds of its own, slices with the seeds of all
other frames, and an independent reference. Frames that are there already are not rendered again.
"""

from __future__ import annotations

import argparse
import math
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bench import ROOT
from bench.support import markdown
from bench.support.bare import shot_child
from bench.support.report import Figure, write_report
from bench.support.videos import seen_beside
from plateau.metric import Half, View
from plateau.metric.compiled import CompiledVisibleDifferences
from plateau.metric.cvvdp import DISPLAYS, ColorVideoVDP, Display, video_jod
from plateau.metric.noise_model import noise_model
from plateau.metric.shots import shot_quality

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from plateau.metric import Image
    from plateau.metric.noise_model import NoiseModel

#: 256 pixels over 45°, as a job's view is by default, and on a desk.
EYES = {
    "wall": Display(5.4, 100, 0.1, 64, transfer="relative"),
    "desk": replace(DISPLAYS["standard_fhd"], transfer="relative"),
}
_SEEDS = {"own": "seeds of its own", "same": "the same seeds"}
_SLICES = (2, shot_child.SLICES)
_REFERENCE_SPP = shot_child.REFERENCE_PASSES * shot_child.REFERENCE_SPP
TRUE, ESTIMATED, ALONE = "true", "estimated", "frames alone"
_FIRST, _LAST = "estimated, first frame", "estimated, last frame"
_NOTES = [
    f"References have {_REFERENCE_SPP} spp and other seeds; their own noise is part of the truth.",
    "Frames alone: the mean over the frames of a still's true quality.",
]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=48, help="of each shot (48)")
    parser.add_argument("--data", type=Path, default=ROOT / "shots-data")
    asked = parser.parse_args()
    figures = []
    for shot in shot_child.SHOTS:
        folder = asked.data / shot
        subprocess.run(
            [sys.executable, "-m", shot_child.__name__, shot, str(asked.frames), str(folder)],
            check=True,
            cwd=ROOT,
        )
        for seeds in _SEEDS:
            for slices in _SLICES:
                frames = Frames(folder, asked.frames, seeds, slices)
                for view, display in EYES.items():
                    for what, jod in qualities(ColorVideoVDP(display), frames).items():
                        name = _name(view, shot, slices, seeds, what)
                        figures.append(Figure(name=name, value=round(jod, 3), unit="JOD"))
    settings = {"frames": asked.frames, "fps": shot_child.FPS}
    report = write_report("shots", figures, settings=settings, notes=_NOTES)
    markdown.fill(markdown.DOCS / "animation.md", tables(report))


class Frames(Sequence["NoiseModel"]):
    """The noise models of a shot's frames at so many slices, one in memory at a time."""

    def __init__(self, folder: Path, count: int, seeds: str, slices: int) -> None:
        self._files = [folder / f"{frame:03}.npz" for frame in range(count)]
        self._seeds, self._slices = seeds, slices
        self._metric = CompiledVisibleDifferences(View())

    def __len__(self) -> int:
        return len(self._files)

    def __getitem__(self, frame: Any) -> Any:
        return noise_model(self._metric, self.pair(frame)[1], self.halves(frame))

    def halves(self, frame: int) -> tuple[Half, Half]:
        """Return the halves of a frame's slices."""
        with np.load(self._files[frame]) as images:
            slices = self._some(images)
        spp = shot_child.SLICE_SPP * self._slices // 2
        return Half(slices[::2].mean(axis=0), spp), Half(slices[1::2].mean(axis=0), spp)

    def pair(self, frame: int) -> tuple[Image, Image]:
        """Return a frame's reference and its image."""
        with np.load(self._files[frame]) as images:
            return images["reference"], self._some(images).mean(axis=0)

    def _some(self, images: Any) -> NDArray[np.float32]:
        slices: NDArray[np.float32] = images[self._seeds][: self._slices]
        return slices


def qualities(eye: ColorVideoVDP, frames: Frames) -> dict[str, float]:
    """Return the quality of a shot in JOD: the truth, the estimate, and that of frames alone."""
    _, seen = seen_beside(eye, shot_child.FPS, len(frames), frames.pair)
    pairs = map(frames.pair, range(len(frames)))
    alone = [eye.compare(eye.percept(truth), eye.percept(image)).jod for truth, image in pairs]
    estimate = shot_quality(eye, shot_child.FPS, frames)
    return {
        TRUE: video_jod(seen),
        ESTIMATED: estimate.jod,
        ALONE: float(np.mean(alone)),
        _FIRST: estimate.frames[0],
        _LAST: estimate.frames[-1],
    }


def _name(view: str, shot: str, slices: int, seeds: str, what: str) -> str:
    return f"{view}: {shot}: {slices * shot_child.SLICE_SPP} spp: {_SEEDS[seeds]}: {what}"


def tables(report: dict[str, Any]) -> dict[str, str]:
    """Return the table by the name of its place in the document."""
    found = {one["name"]: one["value"] for one in report["figures"]}
    rows = []
    for view in EYES:
        for shot in shot_child.SHOTS:
            jods = {
                (seeds, what, slices): found[_name(view, shot, slices, seeds, what)]
                for seeds in _SEEDS
                for what in (TRUE, ESTIMATED, ALONE)
                for slices in _SLICES
            }
            rows += [[view, shot, *_row(jods, slices)] for slices in _SLICES]
    head = [
        *("seen", "moves", "spp", "frames alone", "the video", "estimated", "samples"),
        *("same seeds", "estimated", "samples"),
    ]
    return {"shots": markdown.table(head, rows)}


def _row(jods: dict[tuple[str, str, int], float], slices: int) -> list[str]:
    """Return the qualities at so many slices, and how many times the samples each video needs.

    The video needs them for the quality of its frames alone, and with the same seeds for that with
    seeds of its own. What is lost falls as a power of the samples.
    """
    lost = {key: 10 - jod for key, jod in jods.items()}
    few, many = (lost["own", TRUE, some] for some in _SLICES)
    power = math.log(few / many) / math.log(_SLICES[1] / _SLICES[0])
    own, same = (lost[seeds, TRUE, slices] for seeds in _SEEDS)
    shown = [f"{jods['own', ALONE, slices]:.2f}"]
    for seeds, times in (("own", own / lost["own", ALONE, slices]), ("same", same / own)):
        shown += [f"{jods[seeds, what, slices]:.2f}" for what in (TRUE, ESTIMATED)]
        shown += [f"×{times ** (1 / power):.1f}"]
    return [str(slices * shot_child.SLICE_SPP), *shown]


if __name__ == "__main__":
    main()
