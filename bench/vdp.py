"""CPU time of one evaluation of the metric, as a job makes it: `make bench-vdp`.

In a job the reference is prepared once; an evaluation prepares the new image, compares, maps and
counts. All ways take turns in one run, so that a busy machine slows them alike:

- plain: numpy, every formula for every pixel, reference prepared once
- numpy: `metric.VisibleDifferences`, which computes masking only for pixels that need it; likewise
- compiled: `plateau.metric.compiled`, likewise, on one thread
- FLIP (`pip install flip-evaluator`), on both images, CPU time of all its threads
"""

import argparse
from collections.abc import Callable
from importlib.util import find_spec
from statistics import median
from typing import Any, Final

import numpy as np

from bench.support.processes import cpu_s
from bench.support.recordings import PAPER
from bench.support.report import write_report
from plateau.metric import Image, Mask, Percept, VisibleDifferences
from plateau.metric.csf import contrast_sensitivity, luminance_threshold, masking
from plateau.metric.vdp import BANDS, COLOUR_LUMINANCE, ELEVATION_MAX, ELEVATION_MIN, FLOOR

SIZES: Final = {"512²": (512, 512), "1080p": (1080, 1920), "2160p": (2160, 3840)}
#: Standard deviation of the noise over the signal's: as after a few samples per pixel, and as near
#: a stop, where most pixels need their threshold elevation.
NOISES: Final = {"strong noise": 0.2, "weak noise": 0.02}
_PLAIN, _NUMPY, _COMPILED, _FLIP = "plain numpy", "numpy", "compiled", "FLIP"
#: At most this share of pixels may differ between the ways.
_TOLERANCE: Final = 1e-4


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sizes", nargs="+", choices=SIZES, default=list(SIZES))
    parser.add_argument("--turns", type=int, default=7, help="evaluations of each way")
    options = parser.parse_args()
    cases = [(size, noise) for size in options.sizes for noise in NOISES]
    ways = (_COMPILED, _PLAIN, _NUMPY, *([_FLIP] if find_spec("flip_evaluator") else []))
    write_report(
        "vdp",
        {"vdp": [["image", *ways], *(row(*case, ways, options.turns) for case in cases)]},
        settings={"sizes": options.sizes, "turns": options.turns, "noises": NOISES},
        notes=[
            "CPU time, not wall time. Ratios are of the same turn, to the compiled way.",
            "FLIP prepares both images every time; the other ways only the new one.",
            "Preparing the reference too takes the compiled way 1.3 to 1.6 times as long.",
            "The images are synthetic: gradients and edges with Gaussian noise.",
        ],
        document="metric.md",
    )


def row(size: str, noise: str, ways: tuple[str, ...], turns: int) -> list[str]:
    """Return each way's CPU time, and how many times that of the compiled one it is."""
    reference, test = noisy_pair(SIZES[size], NOISES[noise])
    evaluate = _ours(reference, test)
    if _FLIP in ways:
        from flip_evaluator import evaluate as flip

        # Its "LDR" takes values that a screen can show.
        pair = np.clip(reference, 0, 1), np.clip(test, 0, 1), "LDR"
        evaluate[_FLIP] = lambda: cpu_s(lambda: flip(*pair, inputsRGB=False, applyMagma=False))
        evaluate[_FLIP]()  # loads it
    times = [{name: evaluate[name]() for name in ways} for _ in range(turns)]
    cells = [f"{size}, {noise}"]
    for name in ways:
        spent = median(turn[name] for turn in times)
        ratio = median(turn[name] / turn[_COMPILED] for turn in times)
        first = name == _COMPILED
        cells.append(f"{spent * 1000:.3g} ms" if first else f"{spent:.3g} s ({ratio:.3g})")
    return cells


def _ours(reference: Any, test: Any) -> dict[str, Callable[[], float]]:
    """Return our three ways, warmed up and checked against each other."""
    from plateau.metric.compiled import CompiledVisibleDifferences

    plain, lazy = PlainPredictor(PAPER), VisibleDifferences(PAPER)
    compiled = CompiledVisibleDifferences(PAPER)
    prepared, kept = lazy.percept(reference), compiled.percept(reference)
    kept.keep()

    def evaluate_plainly() -> Any:
        visible = plain.visible(prepared, plain.percept(test))
        return visible, np.count_nonzero(visible)

    def evaluate() -> Any:
        return lazy.compare(prepared, lazy.percept(test)).visible

    def evaluate_compiled() -> Any:
        return compiled.compare(kept, compiled.percept(test)).visible

    expected = evaluate_plainly()[0]
    for visible in (evaluate(), evaluate_compiled()):
        share = np.count_nonzero(visible != expected) / expected.size
        if share > _TOLERANCE:
            raise AssertionError(f"two ways see another difference in {share:.2%} of the pixels")
    return {
        _PLAIN: lambda: cpu_s(evaluate_plainly),
        _NUMPY: lambda: cpu_s(evaluate),
        _COMPILED: lambda: cpu_s(evaluate_compiled),
    }


class PlainPredictor(VisibleDifferences):
    """Applies each formula to every pixel, one after the other, without regard for speed."""

    def visible(self, reference: Percept, test: Percept) -> Mask:
        """Return the map of visible pixels."""
        ours, theirs = reference.levels, test.levels
        level = self.adaptation_level(reference.shape[1])
        adaptation = (ours[level] + theirs[level]) / 2
        adaptation = np.maximum(adaptation, np.float32(FLOOR))

        detail = np.maximum(
            np.abs(ours[:BANDS] - ours[1:-1]), np.abs(theirs[:BANDS] - theirs[1:-1])
        )
        contrast = detail / np.maximum(np.maximum(ours[2:], theirs[2:]), np.float32(FLOOR))
        width = reference.shape[1]
        frequencies = self.frequencies_cpd(width)[:, np.newaxis, np.newaxis]
        weights = self.band_weights(width)[:, np.newaxis, np.newaxis]
        masked = (
            contrast * weights * masking(contrast * contrast_sensitivity(frequencies, adaptation))
        )
        elevation = masked.sum(axis=0) / np.maximum(contrast.sum(axis=0), np.float32(FLOOR))
        elevation = np.clip(elevation, ELEVATION_MIN, ELEVATION_MAX)

        visible: Mask = np.abs(ours[0] - theirs[0]) > elevation * luminance_threshold(adaptation)
        if reference.chroma is not None and test.chroma is not None:
            colour = ((reference.chroma - test.chroma) ** 2).sum(axis=0)
            visible |= (colour > elevation) & (adaptation >= COLOUR_LUMINANCE)
        return visible | reference.non_finite | test.non_finite


def noisy_pair(shape: tuple[int, int], noise: float) -> tuple[Image, Image]:
    """Return two noisy images of one scene, with light that a screen can show."""
    rng = np.random.default_rng(2007)
    y, x = np.mgrid[0 : 1 : shape[0] * 1j, 0 : 1 : shape[1] * 1j].astype(np.float32)
    checks = np.where((np.floor(9 * x) + np.floor(6 * y)) % 2 == 0, 0.8, 0.25)
    scene = np.stack([checks * x, checks * (1 - y), 0.5 * checks], axis=-1)
    noisy = [
        (scene * (1 + noise * rng.normal(size=scene.shape))).astype(np.float32) for _ in range(2)
    ]
    return noisy[0], noisy[1]


if __name__ == "__main__":
    main()
