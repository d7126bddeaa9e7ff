"""Ways to compare two images, as `bench.vdp` times them."""

from __future__ import annotations

import multiprocessing
import os
import shutil
import subprocess
import time
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image as Picture

from bench.support.cores import children_cpu_s
from plateau.metric import VisibleDifferences, encode_srgb
from plateau.metric.csf import contrast_sensitivity, luminance_threshold, masking
from plateau.metric.vdp import BANDS, COLOUR_LUMINANCE, ELEVATION_MAX, ELEVATION_MIN, FLOOR

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from plateau.metric import Image, Mask, Percept


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


class Flip:
    """NVIDIA's FLIP in a process of its own, since it may crash."""

    def __init__(self, reference: Image, test: Image) -> None:
        # FLIP's "LDR" takes values that a screen can show.
        pair = (np.clip(reference, 0, 1), np.clip(test, 0, 1))
        self._child = ProcessPoolExecutor(
            1, multiprocessing.get_context("spawn"), initializer=_receive, initargs=pair
        )

    @staticmethod
    def is_here() -> bool:
        """Whether the package is installed."""
        return find_spec("flip_evaluator") is not None

    def cpu_s(self) -> float | None:
        """Return the CPU time of one comparison, on all threads; None if it ended its process."""
        try:
            return self._child.submit(_flip_cpu_s).result()
        except BrokenProcessPool:
            return None

    def close(self) -> None:
        """End the process."""
        self._child.shutdown()


class PerceptualDiff:
    """Yee's own program, if it is installed; it reads PNG files and runs on one thread."""

    def __init__(self, reference: Image, test: Image, folder: Path) -> None:
        self._files = [folder / "reference.png", folder / "test.png"]
        for file, image in zip(self._files, (reference, test), strict=True):
            Picture.fromarray(encode_srgb(image)).save(file)

    @staticmethod
    def is_here() -> bool:
        """Whether the program is on the PATH."""
        return shutil.which("perceptualdiff") is not None

    def cpu_s(self) -> float:
        """Return the CPU time of one run, start and reading included."""
        before = children_cpu_s()
        # It exits with 1 when the images differ.
        subprocess.run(
            ["perceptualdiff", *self._files],
            env={**os.environ, "OMP_NUM_THREADS": "1"},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            check=False,
        )
        return children_cpu_s() - before


def cpu_s(evaluate: Callable[[], Any]) -> float:
    """Return the CPU time of a call in this process."""
    started = time.process_time()
    evaluate()
    return time.process_time() - started


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


_pair: list[Image] = []


def _receive(reference: Image, test: Image) -> None:
    _pair[:] = [reference, test]


def _flip_cpu_s() -> float:
    from flip_evaluator import evaluate

    reference, test = _pair
    return cpu_s(lambda: evaluate(reference, test, "LDR", inputsRGB=False, applyMagma=False))
