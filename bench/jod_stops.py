"""The quality of the images at which `jod` and `visible` end a job: `make bench-jod_stops`.

Jobs are put together from slices that are drawn, with replacement, from those of a recording. The
mean of the recording is then the converged image, exactly, and each job's quality is known.
"""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image as Picture

from bench.allocating.recordings import SCENES, add_options, recorded
from bench.eyes import VIEWS
from bench.support import markdown
from bench.support.report import figure, last_figures, last_report, renewed, write_report
from plateau.metric import Evidence, Half, Jod, View, Visible, encode_srgb
from plateau.metric.compiled import CompiledVisibleDifferences
from plateau.metric.cvvdp import ColorVideoVDP
from plateau.metric.display import displayed
from plateau.metric.quality import display_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from bench.support.report import Figure
    from plateau.metric import Image, Rule

#: Samples per pixel between two evaluations.
STEP = 100
#: Of every job, as by default.
CAP = 10_000
_CROP, _SCALE = 64, 4
_DRAWN = markdown.DOCS.parent / "images" / "eyes-crops.png"
_RULES = ("jod", "visible")
_STOP, _QUALITY = "{rule} ends", "quality where {rule} ends"
_NOTES = (
    "Slices are drawn with replacement from a recording, whose mean is the converged image.",
    f"Each rule has its defaults and judges every {STEP} spp; `visible` has the default view.",
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    add_options(parser)
    parser.add_argument(
        "--crops",
        action="store_true",
        help="draw crops of these cases for docs/science/eyes.md instead",
    )
    asked = parser.parse_args()
    if asked.crops:
        recordings = (
            recorded(SCENES[name], asked.pixels, asked.spp, asked.slice_spp, asked.data)
            for name in asked.cases
        )
        _draw([crops(recording, asked.slice_spp) for recording in recordings])
        return
    kept = last_figures("jod_stops")
    settings = last_report("jod_stops")["settings"].get("scenes", {})
    for name in asked.cases:
        recording = recorded(SCENES[name], asked.pixels, asked.spp, asked.slice_spp, asked.data)
        scene = f"{name}, {asked.pixels} px"
        settings[scene] = {"spp": asked.slice_spp * len(recording), "slice_spp": asked.slice_spp}
        found = measured(recording, asked.slice_spp, asked.runs)
        kept = renewed(kept, scene, found)
        for one in found:
            print(scene, one.name, one.value, file=sys.stderr)
    report = write_report("jod_stops", kept, settings={"scenes": settings}, notes=_NOTES)
    markdown.fill(markdown.DOCS / "eyes.md", tables(report))


def measured(recording: NDArray[np.float32], slice_spp: int, runs: int) -> list[Figure]:
    """Return where both rules end under each view, and the quality there."""
    converged = recording.mean(axis=0, dtype=np.float64).astype(np.float32)
    found = []

    def ends(rule: type[Jod | Visible], judged: View) -> list[tuple[int, Image]]:
        return [_end(rule(), job(recording, slice_spp, run), judged) for run in range(runs)]

    by_visible = ends(Visible, View())
    for name, density in VIEWS.items():
        view = View(pixels_per_degree=density)
        eye = ColorVideoVDP(display_of(view, converged.shape[1]))
        clean = eye.percept(displayed(converged, view))
        for rule, jobs in {"jod": ends(Jod, view), "visible": by_visible}.items():
            jods = [
                eye.compare(clean, eye.percept(displayed(image, view))).jod for _, image in jobs
            ]
            spp = [float(one) for one, _ in jobs]
            for what, values, unit in ((_STOP, spp, "spp"), (_QUALITY, jods, "JOD")):
                found.append(figure(f"{name}: {what.format(rule=rule)}", values, unit))
    return found


def job(
    recording: NDArray[np.float32], slice_spp: int, run: int
) -> Iterator[tuple[int, Image, tuple[Half, Half]]]:
    """Yield spp, image and halves of a job at each step, of slices drawn from a recording."""
    rng = np.random.default_rng([run, 2024])
    each = STEP // slice_spp // 2  # slices of a half in a step
    sums = np.zeros((2, *recording.shape[1:]))
    for step in range(1, CAP // STEP + 1):
        for half in sums:
            for drawn in rng.integers(len(recording), size=each):
                half += recording[drawn]
        count = step * each
        even, odd = (Half((half / count).astype(np.float32), count * slice_spp) for half in sums)
        image = (sums.sum(axis=0) / (2 * count)).astype(np.float32)
        yield step * STEP, image, (even, odd)


def _end(
    rule: Rule, steps: Iterator[tuple[int, Image, tuple[Half, Half]]], view: View
) -> tuple[int, Image]:
    """Return the spp and the image at which the rule, or the cap, ends the job."""
    metric = CompiledVisibleDifferences(view)
    for spp, image, halves in steps:
        if rule.judge(Evidence(spp, image, halves, metric)).stop or spp == CAP:
            return spp, image
    raise AssertionError("a job has steps up to its cap")


def crops(recording: NDArray[np.float32], slice_spp: int) -> list[Image]:
    """Return a part of the converged image, and of those at which `visible` and `jod` end.

    It is the part, of `_CROP` pixels, in which the screen shows most noise where `visible` ends.
    """
    converged = recording.mean(axis=0, dtype=np.float64).astype(np.float32)
    images = [converged]
    images += [_end(rule, job(recording, slice_spp, 0), View())[1] for rule in (Visible(), Jod())]
    wrong = np.abs(displayed(images[1], View()) - displayed(converged, View())).sum(axis=-1)
    rows, columns = (size // _CROP for size in wrong.shape)
    cells = wrong[: rows * _CROP, : columns * _CROP].reshape(rows, _CROP, columns, _CROP)
    place = int(cells.sum(axis=(1, 3)).argmax())
    y, x = (_CROP * index for index in divmod(place, columns))
    return [image[y : y + _CROP, x : x + _CROP] for image in images]


def _draw(rows: list[list[Image]]) -> None:
    pictures = [np.concatenate([encode_srgb(one) for one in row], axis=1) for row in rows]
    large = np.concatenate(pictures).repeat(_SCALE, axis=0).repeat(_SCALE, axis=1)
    Picture.fromarray(large).save(_DRAWN, optimize=True)
    print(f"drawn to {_DRAWN}")


def tables(report: dict[str, Any]) -> dict[str, str]:
    """Return the table by the name of its place in the document."""
    values = {one["name"]: one for one in report["figures"]}
    scenes = report["settings"]["scenes"]

    def jod(scene: str, view: str, rule: str) -> float:
        return float(values[f"{scene}: {view}: {_QUALITY.format(rule=rule)}"]["value"])

    def cell(scene: str, view: str, rule: str) -> str:
        spp = values[f"{scene}: {view}: {_STOP.format(rule=rule)}"]["value"]
        return f"{spp:,.0f}{' (cap)' * (spp == CAP)} / {jod(scene, view, rule):.2f}"

    rows = [
        [scene, *(cell(scene, view, "jod") for view in VIEWS)]
        + [cell(scene, view, "visible") for view in VIEWS]
        for scene in scenes
    ]
    apart = ["**apart by**"]
    for rule in _RULES:
        for view in VIEWS:
            found = [jod(scene, view, rule) for scene in scenes]
            apart.append(f"**{max(found) - min(found):.2f}**")
    head = ["scene", *(f"`{rule}`, {view}" for rule in _RULES for view in VIEWS)]
    return {"jod-stops": markdown.table(head, [*rows, apart])}


if __name__ == "__main__":
    main()
