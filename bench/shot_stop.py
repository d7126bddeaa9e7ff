"""Where a shot stops: as a video, frame by frame, and all alike: `make bench-shot_stop`.

The shots are those of `bench.shots`, with more slices and seeds of each frame's own, and one whose
frames are not equally noisy. The monitor's own decisions are taken on them. Frames that are there
already are not rendered again.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bench import ROOT
from bench.support import markdown
from bench.support.bare import shot_child
from bench.support.report import Figure, write_report
from bench.support.videos import seen_beside
from plateau.farm.model.spec import JobSpec
from plateau.metric import Evidence, Half, View, create_rule
from plateau.metric.compiled import CompiledVisibleDifferences
from plateau.metric.cvvdp import ColorVideoVDP, video_jod
from plateau.metric.display import displayed
from plateau.metric.noise_model import noise_model
from plateau.metric.quality import display_of
from plateau.metric.shots import samples_needed, shot_quality
from plateau.service.monitor.shots.process import Looked
from plateau.service.monitor.shots.tending import said

if TYPE_CHECKING:
    from plateau.metric import Image
    from plateau.metric.noise_model import NoiseModel
    from plateau.metric.shots import ShotQuality

#: As on a desk.
_VIEW = View(pixels_per_degree=40)
_TARGETS = (9.0, 9.5)
#: The slices of each frame: its cap.
_SLICES = {**dict.fromkeys(shot_child.SHOTS, 24), shot_child.UNEVEN: 48}
#: After these the board covers the whole lamp.
_UNEVEN_FRAMES = 18
#: Slices of a step: each half has one.
_STEP = 2
_STEP_SPP = _STEP * shot_child.SLICE_SPP
#: Passes of a reference.
_PASSES = 4
_SHOT, _ALONE, _ALIKE = "as a shot", "frames alone", "all alike"
_WAYS = (_SHOT, _ALONE, _ALIKE)
_LOOKS, _SPP, _TRUE = "looks", "samples", "true quality"
_MOMENT, _TRUE_MOMENT = "worst moment, estimated", "worst moment, true"
_NOTES = [
    f"References have {_PASSES * shot_child.DEEP_SPP} spp and other seeds. Their noise counts.",
    "Of all frames alike the samples are the fewest that suffice by the estimate.",
]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=48, help="of each shot (48)")
    parser.add_argument("--data", type=Path, default=ROOT / "shots-data" / "stop")
    asked = parser.parse_args()
    figures = []
    for shot, slices in _SLICES.items():
        folder = asked.data / shot
        frames = min(asked.frames, _UNEVEN_FRAMES if shot == shot_child.UNEVEN else asked.frames)
        order = [shot, str(frames), str(folder), str(slices), str(_PASSES)]
        subprocess.run([sys.executable, "-m", shot_child.__name__, *order], check=True, cwd=ROOT)
        recorded = _Recorded(folder, frames, slices)
        for target in _TARGETS:
            for what, (value, unit) in _found(recorded, target).items():
                name = _name(shot, target, what)
                figures.append(Figure(name=name, value=round(value, 3), unit=unit))
    settings = {"frames": asked.frames, "fps": shot_child.FPS, "step": _STEP_SPP}
    report = write_report("shot_stop", figures, settings=settings, notes=_NOTES)
    markdown.fill(markdown.DOCS / "animation.md", tables(report))


class _Recorded:
    """The slices of a shot, and how its frames are at any samples."""

    def __init__(self, folder: Path, frames: int, slices: int) -> None:
        self.files = [folder / f"{frame:03}.npz" for frame in range(frames)]
        self.cap = slices * shot_child.SLICE_SPP
        self.metric = CompiledVisibleDifferences(_VIEW)

    def halves(self, frame: int, spp: int) -> tuple[Any, tuple[Half, Half]]:
        """Return the image of a frame, and its halves."""
        with np.load(self.files[frame]) as images:
            slices = images["own"][: spp // shot_child.SLICE_SPP]
        even, odd = (Half(half.mean(axis=0), spp / 2) for half in (slices[::2], slices[1::2]))
        return slices.mean(axis=0), (even, odd)

    def quality(self, spp: Sequence[int]) -> ShotQuality:
        """Return the quality, as estimated, of the shot whose frames have these samples."""
        return shot_quality(self._eye(), shot_child.FPS, _Models(self, spp), view=_VIEW)

    def truth(self, spp: Sequence[int]) -> tuple[float, float]:
        """Return its true quality, and that of its worst moment."""

        def pair(frame: int) -> tuple[Image, Image]:
            with np.load(self.files[frame]) as images:
                clean = displayed(images["reference"], _VIEW)
            return clean, displayed(self.halves(frame, spp[frame])[0], _VIEW)

        before, seen = seen_beside(self._eye(), shot_child.FPS, len(spp), pair)
        # The mirrored frames' noise is seen twice until the first moment that has none of them.
        return video_jod(seen), min(moment.jod for moment in seen[len(before) :])

    def _eye(self) -> ColorVideoVDP:
        return ColorVideoVDP(display_of(_VIEW, shot_child.WIDTH))


class _Models(Sequence["NoiseModel"]):
    """The noise models of a shot's frames, one in memory at a time."""

    def __init__(self, recorded: _Recorded, spp: Sequence[int]) -> None:
        self._recorded, self._spp = recorded, spp

    def __len__(self) -> int:
        return len(self._spp)

    def __getitem__(self, frame: Any) -> Any:
        return noise_model(self._recorded.metric, *self._recorded.halves(frame, self._spp[frame]))


def _found(recorded: _Recorded, target: float) -> dict[str, tuple[float, str]]:
    looks, spp = _as_a_shot(recorded, target)
    frames = range(len(recorded.files))
    found: dict[str, tuple[float, str]] = {_LOOKS: (looks, "looks")}
    stops = {
        _SHOT: spp,
        _ALONE: [_alone(recorded, frame, target) for frame in frames],
        _ALIKE: [_alike(recorded, target)] * len(frames),
    }
    for way, spent in stops.items():
        true, worst = recorded.truth(spent)
        found |= {
            f"{way}: {_SPP}": (float(np.mean(spent)), "spp"),
            f"{way}: {_MOMENT}": (min(recorded.quality(spent).low_frames), "JOD"),
            f"{way}: {_TRUE_MOMENT}": (worst, "JOD"),
            f"{way}: {_TRUE}": (true, "JOD"),
        }
    return found


def _as_a_shot(recorded: _Recorded, target: float) -> tuple[int, list[int]]:
    """Return the looks, and the samples of each frame, of a shot that begins low."""
    spp = [_STEP_SPP] * len(recorded.files)
    spec = JobSpec.model_validate(
        {
            "shot": {"fps": shot_child.FPS, "target": target},
            "step": _STEP_SPP,
            "slice_spp": shot_child.SLICE_SPP,
            "max_spp": recorded.cap,
        }
    )
    looks = 0
    while True:
        quality = recorded.quality(spp)
        looks += 1
        about = {
            **vars(quality),
            "worst_frame": 0,
            "needed": samples_needed(quality, shot_child.FPS, target, spp),
        }
        looked = Looked(about=about, heat=np.zeros((1, 1), np.float32), seconds=0.0)
        found = said(spec, tuple(spp), frozenset(range(len(spp))), looked)
        if found.over is not None:
            return looks, spp
        for frame, needed in found.asked.items():
            spp[frame] = needed


def _alone(recorded: _Recorded, frame: int, target: float) -> int:
    """Return where the rule `jod` stops a frame as a still, or the cap."""
    rule = create_rule("jod", target=target, min_spp=1)
    for spp in range(_STEP_SPP, recorded.cap + 1, _STEP_SPP):
        image, halves = recorded.halves(frame, spp)
        evidence = Evidence(spp=spp, image=image, halves=halves, metric=recorded.metric)
        if rule.judge(evidence).stop:
            return spp
    return recorded.cap


def _alike(recorded: _Recorded, target: float) -> int:
    """Return the fewest samples with which all frames make each moment good enough, or the cap."""
    for spp in range(_STEP_SPP, recorded.cap, _STEP_SPP):
        if min(recorded.quality([spp] * len(recorded.files)).low_frames) >= target:
            return spp
    return recorded.cap


def _name(shot: str, target: float, what: str) -> str:
    return f"{shot}: {target:g} JOD: {what}"


def tables(report: dict[str, Any]) -> dict[str, str]:
    """Return the table by the name of its place in the document."""
    found = {one["name"]: one["value"] for one in report["figures"]}
    rows = []
    for shot, slices in _SLICES.items():
        for target in _TARGETS:
            row = [shot, f"{target:g}", f"{found[_name(shot, target, _LOOKS)]:.0f}"]
            for way in _WAYS:
                spp, moment, true_moment, true = (
                    found[_name(shot, target, f"{way}: {what}")]
                    for what in (_SPP, _MOMENT, _TRUE_MOMENT, _TRUE)
                )
                row.append(_spp(spp, slices * shot_child.SLICE_SPP))
                row.append(f"{moment:.2f} / {true_moment:.2f}, {true:.2f}")
            rows.append(row)
    head = ["moves", "target", "looks"]
    for way in _WAYS:
        head += [f"{way}, spp", "JOD"]
    return {"shot-stop": markdown.table(head, rows)}


def _spp(mean: float, cap: int) -> str:
    return f"over {cap}" if mean >= cap else f"{mean:.0f}"


if __name__ == "__main__":
    main()
