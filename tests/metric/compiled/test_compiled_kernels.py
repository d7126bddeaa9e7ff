"""What the compiled predictor is made of: its arithmetic, its loops, and its cache."""

import inspect
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest
from numpy.typing import NDArray

import plateau.metric.compiled
from plateau.metric import kernel_cache
from plateau.metric.compiled import (
    CompiledVisibleDifferences,
    denoise,
    elevation,
    jit,
    levels,
    light,
    threshold,
)
from plateau.metric.csf import CONE_CURVE_FROM, CONE_LINE_FROM, ROD_LINE_FROM, luminance_threshold
from plateau.metric.kernel_cache import cache_folder
from plateau.metric.vdp import VisibleDifferences


def thresholds(luminance):
    out = np.empty_like(luminance)
    for start in range(0, luminance.size, 100):
        part = slice(start, start + 100)
        threshold.per_threshold(luminance[part], out[part], luminance[part].size)
    return 1 / out.astype(np.float64)


@pytest.mark.parametrize("brightest", [1e-3, 1e4])
def test_thresholds_are_those_of_numpy(brightest):
    # From full darkness on; the darker half has no slice that is bright throughout.
    luminance = np.geomspace(1e-5, brightest, 50_000, dtype=np.float32)
    # At a border either piece may be taken.
    log_light = np.log10(luminance.astype(np.float64))
    borders = np.array([ROD_LINE_FROM, CONE_CURVE_FROM, CONE_LINE_FROM, -3.94])
    luminance = luminance[np.abs(log_light[:, np.newaxis] - borders).min(axis=1) > 1e-5]
    np.testing.assert_allclose(thresholds(luminance), luminance_threshold(luminance), rtol=3e-6)


LOOPS = [
    *(light.show, light.luminance, light.response, light.opponent),
    *(levels._blur_down, threshold.adaptation, threshold._by_every_piece),
    *(threshold._by_the_brighter_pieces, threshold.luminance_strength, threshold.add_colour),
    *(elevation.contrast, elevation.total, elevation.weighted_total, elevation.decide_by_range),
    *(denoise._add_up, denoise._add_squares, denoise._find_gain, denoise._add_kept),
    *(elevation.find_open, elevation.sensitivity, elevation.add_masked, elevation.decide),
]


def argument_type(annotation):
    if annotation is int:
        return numba.int64
    if annotation is np.float32:
        return numba.float32
    if annotation == tuple[np.float32, np.float32, np.float32]:
        return numba.types.UniTuple(numba.float32, 3)
    dtypes = {NDArray[np.bool_]: numba.boolean, NDArray[np.uint8]: numba.uint8}
    return dtypes.get(annotation, numba.float32)[::1]


@pytest.mark.parametrize("loop", LOOPS, ids=lambda loop: loop.py_func.__name__)
def test_every_loop_is_vectorised(loop):
    function = loop.py_func
    types = tuple(
        argument_type(annotation)
        for name, annotation in inspect.get_annotations(function).items()
        if name != "return"
    )
    compiled = numba.njit(error_model="numpy")(function)
    compiled.compile(types)
    assert re.search(r"fadd|fmul|fcmp|fsub", compiled.inspect_llvm(types))
    assert re.search(r"= (fadd|fmul|fcmp \w+|fsub) <\d+ x float>", compiled.inspect_llvm(types))


#: Prints a digest of everything that the kernels make of two noisy images, bright and dark.
DIGEST = """
import hashlib
import numpy as np
from plateau.metric import View
from plateau.metric.compiled import CompiledVisibleDifferences

generator = np.random.default_rng(3)
pair = [generator.gamma(2, 0.2, (60, 200, 3)).astype(np.float32) for _ in range(2)]
digest = hashlib.sha256()
for exposure_ev in (0, -10):
    metric = CompiledVisibleDifferences(View(exposure_ev=exposure_ev))
    percepts = [metric.percept(image) for image in pair]
    digest.update(metric.compare(*percepts).visible)
    digest.update(np.ascontiguousarray(percepts[0].levels))
    digest.update(np.ascontiguousarray(percepts[0].chroma))
print(digest.hexdigest())
"""


@pytest.mark.long
def test_a_plain_cpu_gives_the_same_bits_as_this_one(tmp_path):
    # The plain one has short vectors and no fused multiply-add.
    plain = {"NUMBA_CPU_NAME": "generic", "NUMBA_CACHE_DIR": str(tmp_path)}
    digests = [
        subprocess.check_output([sys.executable, "-c", DIGEST], env={**os.environ, **extra})
        for extra in ({}, plain)
    ]
    assert digests[0] == digests[1]


class TestTheCache:
    @pytest.fixture(autouse=True)
    def _asked_anew(self):
        cache_folder.cache_clear()
        yield
        cache_folder.cache_clear()

    def test_it_is_where_numba_is_told(self, monkeypatch, tmp_path):
        monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "kernels"))
        assert cache_folder().parent == tmp_path / "kernels"
        assert cache_folder().is_dir()

    def test_else_it_is_beside_the_package(self, monkeypatch):
        monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
        package = Path(plateau.metric.compiled.__file__).parent
        assert cache_folder().parent == package / "__pycache__"

    def test_else_with_the_user(self, monkeypatch, tmp_path):
        # The package lies where nothing can be written: a file is in the way.
        (tmp_path / "package").touch()
        monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
        monkeypatch.setattr(kernel_cache, "_PACKAGE", tmp_path / "package")
        monkeypatch.setattr(kernel_cache, "user_cache_path", lambda name: tmp_path / "user" / name)
        assert cache_folder().parent == tmp_path / "user" / "plateau-kernels"

    def test_else_there_is_none_and_kernels_work_all_the_same(self, monkeypatch, tmp_path):
        (tmp_path / "file").touch()
        monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file"))
        assert cache_folder() is None
        twice = jit.entry_point(lambda x: x + x)
        assert twice(2) == 4

    def test_numba_s_own_setting_is_left_alone(self, monkeypatch, tmp_path):
        monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
        jit.entry_point(lambda x: x)
        assert str(tmp_path) == numba.config.CACHE_DIR

    @pytest.mark.parametrize("source", ["csf.py", "compiled/elevation.py"])
    def test_a_changed_constant_makes_another_one(self, monkeypatch, tmp_path, source):
        package = Path(plateau.metric.compiled.__file__).parents[1]
        shutil.copytree(package, tmp_path / "metric", ignore=shutil.ignore_patterns("__pycache__"))
        monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
        monkeypatch.setattr(kernel_cache, "_PACKAGE", tmp_path / "metric" / "compiled")
        before = cache_folder()
        with (tmp_path / "metric" / source).open("a") as file:
            file.write("\nNEW = 1\n")
        cache_folder.cache_clear()
        assert cache_folder() != before


@pytest.mark.parametrize("shape", [(64, 70), (33, 17), (2, 9), (40, 1), (1, 1)])
@pytest.mark.parametrize("sigma", [0, 0.01, 0.3])
def test_denoising_is_that_of_numpy_to_the_bit(shape, sigma):
    rng = np.random.default_rng(5)
    light = np.add.outer(*(np.linspace(0, 0.5, side, dtype=np.float32) for side in shape))
    image, noise = (
        rng.normal(0, sigma, (*shape, 3)).astype(np.float32) + mean
        for mean in (light[..., np.newaxis], np.float32(0))
    )
    image[: shape[0] // 2] = 0.25  # where there is nothing, neither of the image nor of noise
    noise[: shape[0] // 2] = 0
    ours, numpys = (
        metric.denoised(image, noise) for metric in (CompiledVisibleDifferences, VisibleDifferences)
    )
    assert ours.dtype == numpys.dtype
    assert np.array_equal(ours, numpys)
