"""What a focus saves, if a model of saliency says where people look: `make bench-attention`.

Jobs are replayed from the recordings of `bench.allocation`, with and without a focus: OpenCV's
spectral residual (Hou and Zhang 2007, doi 10.1109/CVPR.2007.383267) of the converged image. Another
is the middle third of the image, as a person may say. What each leaves visible is counted by the
noise of the whole recording: where the focus has more than its median weight, and elsewhere.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

import numpy as np

from bench.allocating.film import Film
from bench.allocating.recordings import SCENES, add_options, recorded
from bench.allocating.truth import Truth
from bench.allocating.ways import Frames, Zones
from bench.allocation import TARGET, ended
from bench.support import markdown
from bench.support.report import Figure, last_figures, last_report, renewed, write_report
from plateau.farm.model.spec.view import MOST_FOCUS
from plateau.metric import View, encode_srgb, focus_plane
from plateau.metric.compiled import CompiledVisibleDifferences

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from bench.allocating.ways import Way

#: The least weight, of the greatest: nobody is sure to look nowhere.
LEAST = 0.1
WAYS: dict[str, Callable[[], Way]] = {"whole frames": Frames, "zones": lambda: Zones(16)}
_SPP, _INSIDE, _OUTSIDE = "spp", "visible where one looks", "visible elsewhere"
_UNITS = {_SPP: "spp", _INSIDE: "of these pixels", _OUTSIDE: "of these pixels"}


def middle(image: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return a focus on the middle third of an image."""
    return focus_plane([[LEAST, 1, LEAST]], *image.shape[:2])


def salient(image: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return the focus that the model of saliency makes of an image, as a job's focus is."""
    import cv2  # of the extra `opinions`

    shown = encode_srgb(image.astype(np.float32))
    model = cv2.saliency.StaticSaliencySpectralResidual_create()
    _, saliency = model.computeSaliency(np.ascontiguousarray(shown[..., ::-1]))
    height, width = saliency.shape
    coarse = cv2.resize(saliency, (MOST_FOCUS, MOST_FOCUS), interpolation=cv2.INTER_AREA)
    weights: NDArray[np.float64] = np.maximum(coarse / coarse.max(), LEAST)
    return focus_plane(weights.tolist(), height, width)


#: What makes a focus of a converged image.
FOCI: dict[str, Callable[[NDArray[np.float64]], NDArray[np.float32]]] = {
    "saliency": salient,
    "the middle third": middle,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    add_options(parser)
    asked = parser.parse_args()
    kept = last_figures("attention")
    names = list(last_report("attention")["settings"].get("scenes", []))
    for name in asked.cases:
        recording = recorded(SCENES[name], asked.pixels, asked.spp, asked.slice_spp, asked.data)
        rows = measured(recording, asked.slice_spp, asked.runs)
        kept = renewed(
            kept,
            name,
            (
                Figure(name=f"{way}: {what}", value=value, unit=_UNITS[what])
                for way, row in rows.items()
                for what, value in row.items()
            ),
        )
        names += [name] if name not in names else []
    about = {"target": TARGET, "least weight": LEAST, "runs": asked.runs, "scenes": names}
    notes = ["One looks where the weight is above the median."]
    report = write_report("attention", kept, settings=about, notes=notes)
    markdown.fill(markdown.DOCS / "allocation.md", tables(report))


def measured(
    recording: NDArray[np.float32], slice_spp: int, runs: int
) -> dict[str, dict[str, float]]:
    """Return what each way spent and left with each focus, as means over the runs.

    A way that did not end in one of them is left out.
    """
    metric = CompiledVisibleDifferences(View())
    truth = Truth(metric, recording, slice_spp)
    image = recording.mean(axis=0, dtype=np.float64)
    weights = {name: focus(image) for name, focus in FOCI.items()}
    rows: dict[str, list[dict[str, float]]] = {}
    for run in range(runs):
        order = np.random.default_rng(run).permutation(len(recording))
        for asked in (None, *weights):
            film = Film(recording, slice_spp, order, None if asked is None else weights[asked])
            for way, allocator in WAYS.items():
                film.clear()
                if ended(film, allocator(), metric) is None:
                    continue
                visible = truth.visible(film.spp)
                for focus in weights if asked is None else (asked,):
                    looked_at = weights[focus] > np.median(weights[focus])
                    row = (film.mean_spp, visible[looked_at].mean(), visible[~looked_at].mean())
                    name = _name(way, focus, is_asked=asked is not None)
                    rows.setdefault(name, []).append(
                        dict(zip(_UNITS, map(float, row), strict=True))
                    )
    return {
        way: {what: float(np.mean([row[what] for row in some])) for what in _UNITS}
        for way, some in rows.items()
        if len(some) == runs
    }


def _name(way: str, focus: str, *, is_asked: bool) -> str:
    return f"{way}, {focus}: {'with' if is_asked else 'without'}"


def tables(report: dict[str, Any]) -> dict[str, str]:
    """Return the table by the name of its place in the document."""
    values = {one["name"]: one["value"] for one in report["figures"]}

    def row(scene: str, focus: str, way: str) -> list[str]:
        names = [_name(way, focus, is_asked=is_asked) for is_asked in (False, True)]
        if any(f"{scene}: {name}: {_SPP}" not in values for name in names):
            return [scene, focus, way, *["not ended"] * 3]
        plain, focused = ([values[f"{scene}: {name}: {what}"] for what in _UNITS] for name in names)
        both = zip(plain[1:], focused[1:], strict=True)
        left = (f"{one:.3%}, {other:.3%}" for one, other in both)
        return [scene, focus, way, f"{plain[0] / focused[0]:.2f}", *left]

    head = [
        "scene",
        "focus",
        "samples by",
        "times fewer samples",
        "visibly wrong where one looks: without, with",
        "elsewhere: without, with",
    ]
    rows = [
        row(scene, focus, way)
        for scene in report["settings"]["scenes"]
        for focus in FOCI
        for way in WAYS
    ]
    return {"attention": markdown.table(head, rows)}


if __name__ == "__main__":
    main()
