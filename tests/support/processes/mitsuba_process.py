"""A process with the real renderer in it: a process can only ever use one Mitsuba variant."""

import multiprocessing
import os
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import numpy as np
import psutil
from numpy.typing import NDArray

from plateau.farm.model.slices.zones import Zone
from plateau.worker.renderers.contract import Load, Loaded
from plateau.worker.supervisor.scene_cache import loading_threads
from tests.support.processes.own_processes import end_with_parent

# Mitsuba is imported in the process alone: the tests' own must be able to die of nothing.
_renderer: Any


class MitsubaProcess(AbstractContextManager["MitsubaProcess"]):
    """Hands calls to a `Renderer` of its own, in another process, exceptions included."""

    def __init__(self, variant: str, llvm_library: str | None = None, threads: int = 2) -> None:
        self.variant = variant
        self._pool = ProcessPoolExecutor(
            1,
            mp_context=multiprocessing.get_context("spawn"),
            initializer=_start,
            initargs=(variant, llvm_library, threads),
        )

    def load(
        self,
        folder: Path,
        entry: str = "scene.xml",
        sensor: int = 0,
        aovs: tuple[str, ...] = (),
        **parameters: object,
    ) -> Loaded:
        strings = {name: str(value) for name, value in parameters.items()}
        return self.call(_load, folder, entry, strings, sensor, aovs)

    def render_pass(self, spp: int, seed: int) -> NDArray[np.float32]:
        return self.call(_render_pass, spp, seed)

    def call(self, function: Callable[..., Any], *arguments: object) -> Any:
        """Call a module-level function in the process."""
        return self._pool.submit(function, *arguments).result(timeout=120)

    def __exit__(self, *_: object) -> None:
        self._pool.shutdown()


def _start(variant: str, llvm_library: str | None, threads: int) -> None:
    global _renderer
    end_with_parent()
    if llvm_library is not None:
        os.environ["DRJIT_LIBLLVM_PATH"] = llvm_library
    from plateau.worker.renderers.mitsuba.renderer import Renderer

    _renderer = Renderer(variant, threads)


def _load(
    folder: Path, entry: str, parameters: dict[str, str], sensor: int, aovs: tuple[str, ...]
) -> Loaded:
    return _renderer.load(
        Load(
            folder=str(folder),
            entry=entry,
            parameters=parameters,
            sensor=sensor,
            aovs=aovs,
            threads=loading_threads(folder),
        )
    )


def _render_pass(spp: int, seed: int) -> NDArray[np.float32]:
    (film,) = _renderer.render([(spp, seed)], is_cancelled=lambda: False)
    return film


_scenes: list[object] = []


def scene_in_use() -> int:
    """Which scene is loaded: another one has another number."""
    assert _renderer._prepared is not None
    _scenes.append(_renderer._prepared.scene)  # alive, so that no other has its place in memory
    return id(_scenes[-1])


def films_until_cancelled(passes: list[tuple[int, int]], begun: int) -> list[NDArray[np.float32]]:
    """The films of passes of which no more than so many may begin."""
    left = iter(range(begun))
    return [
        film.copy()
        for film in _renderer.render(passes, is_cancelled=lambda: next(left, None) is None)
    ]


def zones_of_pass(
    spp: int, seed: int, zones: list[tuple[int, int, int, int]], chunk: int
) -> NDArray[np.float32]:
    """The film of these zones, rendered in chunks of so many samples; of all, where none are."""
    kernel = _renderer._kernel
    assert kernel is not None
    kernel._samples = chunk
    wanted = [Zone(*one) for one in zones]
    (film,) = _renderer.render([(spp, seed)], zones=wanted, is_cancelled=lambda: False)
    return film


def chunks_of_pass(spp: int, samples: int) -> list[int]:
    """The samples of the chunks of a pass, of which the largest may have so many."""
    kernel = _renderer._kernel
    assert kernel is not None
    kernel._samples = samples
    chunks = kernel._chunks([(spp, 7)], [], lambda: False)
    return [spp * film.pixels(bands).size for film, bands, _, _ in chunks]


def machine_code_of_pass(spp: int) -> list[str]:
    """The hashes of the kernels that Dr.Jit runs for a pass of so many spp."""
    import drjit as dr

    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        _render_pass(spp, 7)
        return [one["hash"] for one in dr.kernel_history() if one["type"] == dr.KernelType.JIT]


def recordings() -> int:
    """How often the loaded scene was traced."""
    return _renderer._kernel._recorded.n_recordings


def next_chunk_after(samples: int, sample_s: float) -> int:
    """The most samples of a chunk, after one whose samples took so many seconds each."""
    kernel = _renderer._kernel
    assert kernel is not None
    kernel._samples = samples
    kernel._adjust(sample_s)
    return kernel._samples


def by_mitsuba(spp: int, seeds: range) -> NDArray[np.float64]:
    """The raw films that Mitsuba's own `render` makes, one for each seed."""
    one = _renderer._prepared
    assert one is not None
    films = []
    for seed in seeds:
        one.integrator.render(one.scene, one.sensor, seed=seed, spp=spp, develop=False)
        films.append(np.array(one.film.develop(raw=True), dtype=np.float64))
    return np.stack(films)


def add_clock() -> None:
    """Add an integrator ``clock``: what it sees grows with the time within the shutter."""
    import mitsuba as mi

    class Clock(mi.SamplingIntegrator):  # type: ignore[misc]
        def sample(self, _scene, _sampler, ray, *_):  # type: ignore[no-untyped-def]
            return mi.Color3f(ray.time**2), mi.Bool(True), []

    mi.register_integrator("clock", Clock)


def resident_bytes() -> int:
    """The memory that the process has in use."""
    return psutil.Process().memory_info().rss


def why_black(*zones: Zone) -> str:
    """Why a film of the loaded scene, or of these zones, is black."""
    return _renderer.why_black(zones)
