"""The quality of denoised shots, estimated, against the truth: `make bench-denoised_shots`.

A shot of `bench.shots` with deep references: what is wrong with denoised frames is little, and the
noise of shallow ones would hide it. Frames that are there already are not rendered again.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bench import ROOT
from bench.shots import ALONE, ESTIMATED, EYES, TRUE, Frames, qualities
from bench.support import markdown
from bench.support.bare import shot_child
from bench.support.report import Figure, write_report
from plateau.metric import View, blended
from plateau.metric.cvvdp import ColorVideoVDP
from plateau.metric.shots import shot_quality
from plateau.service.monitor.denoising import oidn

if TYPE_CHECKING:
    from plateau.metric import BlendError, Image

_SHOT = "camera"
_SLICES = (2, shot_child.SLICES)
_PASSES = 16
_RAW, _AT_LEAST = "as rendered", "at least"
_NOTES = [
    f"References have {_PASSES * shot_child.DEEP_SPP} spp and other seeds.",
    "Open Image Denoise without guides, blended by risk.",
    "Frames alone: the mean over the frames of a still's true quality.",
]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=12, help="of the shot (12)")
    parser.add_argument("--data", type=Path, default=ROOT / "shots-data" / "denoised")
    asked = parser.parse_args()
    folder = asked.data / _SHOT
    order = [_SHOT, str(asked.frames), str(folder), str(shot_child.SLICES), str(_PASSES)]
    subprocess.run([sys.executable, "-m", shot_child.__name__, *order], check=True, cwd=ROOT)
    figures = []
    for slices in _SLICES:
        raw = Frames(folder, asked.frames, "own", slices)
        denoised = _Denoised(folder, asked.frames, "own", slices)
        for view, display in EYES.items():
            eye = ColorVideoVDP(display)
            found = qualities(eye, denoised)
            found[_AT_LEAST] = shot_quality(eye, shot_child.FPS, denoised).low_jod
            found[_RAW] = qualities(eye, raw)[TRUE]
            figures += [
                Figure(name=_name(view, slices, what), value=round(found[what], 3), unit="JOD")
                for what in (_RAW, ALONE, TRUE, ESTIMATED, _AT_LEAST)
            ]
    settings = {"frames": asked.frames, "fps": shot_child.FPS, "moves": _SHOT}
    report = write_report("denoised_shots", figures, settings=settings, notes=_NOTES)
    markdown.fill(markdown.DOCS / "animation.md", tables(report))


class _Denoised(Frames):
    """The errors of a shot's frames, denoised."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._blended = cache(self._blend)

    def __getitem__(self, frame: Any) -> Any:
        return self._blended(frame)[1]

    def pair(self, frame: int) -> tuple[Image, Image]:
        reference, _ = super().pair(frame)
        return reference, self._blended(frame)[0]

    def _blend(self, frame: int) -> tuple[Image, BlendError]:
        denoise, _ = oidn.denoiser((), View())
        blend, error = blended(super().pair(frame)[1], self.halves(frame), denoise, View())
        return blend.image, error


def _name(view: str, slices: int, what: str) -> str:
    return f"{view}: {slices * shot_child.SLICE_SPP} spp: {what}"


def tables(report: dict[str, Any]) -> dict[str, str]:
    """Return the table by the name of its place in the document."""
    found = {one["name"]: one["value"] for one in report["figures"]}
    rows = [
        [
            view,
            str(slices * shot_child.SLICE_SPP),
            *(
                f"{found[_name(view, slices, what)]:.2f}"
                for what in (_RAW, ALONE, TRUE, ESTIMATED, _AT_LEAST)
            ),
        ]
        for view in EYES
        for slices in _SLICES
    ]
    head = ["seen", "spp", "the video as rendered", "denoised frames alone", "their video"]
    return {"denoised-shots": markdown.table([*head, "estimated", "surely at least"], rows)}


if __name__ == "__main__":
    main()
