"""CPU time of one evaluation of the metric, as a job makes it: `make bench-vdp`.

In a job the reference is prepared once; an evaluation prepares the new image and compares. The
alternative prepares both images each time, as a comparison of two files does. Both are the same
numpy code on one thread, run in turns in one process.
"""

from __future__ import annotations

import argparse
import time
from typing import TYPE_CHECKING

import numpy as np

from bench.support.report import Figure, figure, write_report
from metric import View, VisibleDifferences

if TYPE_CHECKING:
    from collections.abc import Callable

    from metric import Image

SIZES = {"512²": (512, 512), "1080p": (1080, 1920), "2160p": (2160, 3840)}
#: Standard deviation of the noise over the signal's: as after a few samples per pixel, and as near
#: a stop, where most pixels need their threshold elevation worked out.
NOISES = {"strong noise": 0.2, "weak noise": 0.02}

_ALTERNATIVE = "the same numpy metric with the reference prepared anew each time"
_GOALS = {"512²": "at least 7", "1080p": "at least 11", "2160p": "at least 16"}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sizes", nargs="+", choices=SIZES, default=["512²", "1080p"])
    parser.add_argument("--pairs", type=int, default=7, help="evaluations of each way")
    options = parser.parse_args()

    figures = [
        one
        for size in options.sizes
        for noise in NOISES
        for one in _measure(size, noise, options.pairs)
    ]
    write_report(
        "vdp",
        figures,
        settings={"sizes": options.sizes, "pairs": options.pairs, "noises": NOISES},
        notes=[
            "CPU time of the process (time.process_time), not wall time.",
            "The goals are those of compiled kernels against numpy; this is numpy against numpy.",
            "The images are synthetic: gradients and edges with Gaussian noise.",
        ],
    )


def _measure(size: str, noise: str, pairs: int) -> list[Figure]:
    """Return the CPU time of an evaluation, and how many times the alternative's it is faster."""
    metric = VisibleDifferences(View())
    first, second = _pair(SIZES[size], NOISES[noise])
    prepared = metric.percept(first)

    def evaluate() -> int:
        return metric.compare(prepared, metric.percept(second)).count

    def evaluate_anew() -> int:
        return metric.compare(metric.percept(first), metric.percept(second)).count

    if evaluate() != evaluate_anew():  # which also warms both up
        raise AssertionError("the two ways do not see the same difference")
    ours, theirs = [], []
    for _ in range(pairs):
        theirs.append(_cpu_s(evaluate_anew))
        ours.append(_cpu_s(evaluate))
    ratios = [slow / fast for slow, fast in zip(theirs, ours, strict=True)]
    name = f"one evaluation, {size}, {noise}"
    return [
        figure(f"{name}: CPU time", ours, "s"),
        figure(
            f"{name}: times faster",
            ratios,
            "ratio",
            compared_with=_ALTERNATIVE,
            goal=_GOALS[size],
        ),
    ]


def _cpu_s(evaluate: Callable[[], int]) -> float:
    started = time.process_time()
    evaluate()
    return time.process_time() - started


def _pair(shape: tuple[int, int], noise: float) -> tuple[Image, Image]:
    """Return two noisy images of one scene, of light that a screen can show."""
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
