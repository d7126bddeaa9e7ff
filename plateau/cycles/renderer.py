"""Hosts Blender, in the render child alone: loads a scene and renders stretches of samples."""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from plateau.cycles import devices, known_scene
from plateau.cycles.blender import blender, bpy
from plateau.cycles.passes import ask_for, left_out, matte_attributes
from plateau.cycles.scene_prep import open_scene, prepare
from plateau.farm.images.exr import decode_header, decode_layers
from plateau.farm.model.seeds import SEQUENCE_SAMPLES
from plateau.worker.renderers.canary import Canary, known_sphere
from plateau.worker.renderers.contract import CHANNELS, Loaded, SceneError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from numpy.typing import NDArray

    from plateau.cycles.passes import Passes
    from plateau.cycles.scene_prep import PreparedScene
    from plateau.farm.model.slices.zones import Zone
    from plateau.worker.renderers.contract import Load

_CANARY_SPP: Final = 64
#: A part of a pass takes about so long, ...
_PART_S: Final = 1.0
#: ... or so many times what a render of nothing takes, where that is more.
_OVERHEADS: Final = 8
#: Samples of the first part of a scene, whose speed is not known yet.
_FIRST_SAMPLES: Final = 2**16


class Renderer:
    """Cycles as `plateau.worker.renderers.contract.Renderer` has it; needs Linux.

    A pass is a stretch of samples of one of Cycles' sequences. A seed says which: the sequence is
    `seed // SEQUENCE_SAMPLES`, and the first sample the rest. A pass is rendered in bands of rows,
    which have the bits that they have in the whole film.
    """

    def __init__(self, variant: str, threads: int) -> None:
        if variant not in ("cpu", *devices.KINDS):
            raise ValueError(f"Cycles has no variant {variant!r}")
        self._device, self._threads = variant, threads
        # A file without a name, in memory: nothing of it remains, however the process ends.
        self._file = os.memfd_create("film")
        self._one: PreparedScene | None = None
        self._passes: Passes | None = None
        self._overhead_s = 0.0
        self._samples_per_s = 0.0

    def probe(self) -> Canary:
        """Render a diffuse sphere in white light from everywhere, seen without perspective."""
        with blender():
            scene = known_scene.build()
        self._take(prepare(scene, {}, self._threads), ())
        (film,) = self.render([(_CANARY_SPP, 1)], is_cancelled=lambda: False)
        return Canary(film=film, truth=known_sphere(known_scene.SIZE), spp=_CANARY_SPP)

    def load(self, request: Load) -> Loaded:
        """Open a Blender file in the place of the one before; errors carry Blender's message."""
        self._one = None
        if request.sensor != 0:
            raise SceneError("a Blender file has sensor 0 alone; name a camera by its parameter")
        folder = Path(request.folder)
        scene = open_scene(folder / request.entry, folder)
        return self._take(prepare(scene, request.parameters, self._threads), request.aovs)

    def render(
        self,
        passes: Iterable[tuple[int, int]],
        *,
        zones: Sequence[Zone] = (),
        is_cancelled: Callable[[], bool],
    ) -> Iterator[NDArray[np.float32]]:
        """Yield the film of each pass, in order, before it is divided by its weights."""
        if self._one is None:
            raise RuntimeError("no scene is loaded")
        if zones:
            raise SceneError("Cycles renders whole films here, and no zones")
        for spp, seed in passes:
            bands = []
            top = 0
            while top < self._one.height:
                if is_cancelled():
                    return
                rows = self._next_rows(self._one, top, spp)
                bands.append(self._timed(self._one, top, rows, spp, seed))
                top += rows
            yield np.concatenate(bands)

    def _take(self, one: PreparedScene, aovs: tuple[str, ...]) -> Loaded:
        """Have a scene rendered from now on; its first render builds what all others share."""
        devices.use(one.scene, self._device)
        wanted, notes = ask_for(one.scene, one.layer, aovs)
        self._samples_per_s = 0.0
        for _ in range(2):
            began = time.monotonic()
            written = self._written(one, 0, 1, 1, 0)
            self._overhead_s = time.monotonic() - began
        passes, unknown = wanted.among(decode_layers(written))
        self._one, self._passes = one, passes
        return Loaded(
            width=one.width,
            height=one.height,
            channels=(*CHANNELS, *("A" * one.has_alpha), *passes.names),
            ids=passes.ids,
            quotients=passes.quotients,
            notes=(*one.notes, *notes, *([left_out(unknown)] if unknown else [])),
            look="" if one.look is None else one.look.as_text(),
            header=matte_attributes(decode_header(written)),
        )

    def _next_rows(self, one: PreparedScene, top: int, spp: int) -> int:
        """Return how many rows to render next, so that the parts of a pass are of one size."""
        part_s = max(_PART_S, _OVERHEADS * self._overhead_s)
        samples = self._samples_per_s * part_s or _FIRST_SAMPLES
        most = max(1, int(samples / (one.width * spp)))
        left = one.height - top
        return -(-left // -(-left // most))

    def _timed(
        self, one: PreparedScene, top: int, rows: int, spp: int, seed: int
    ) -> NDArray[np.float32]:
        began = time.monotonic()
        band = self._band(one, top, rows, spp, seed)
        took_s = max(time.monotonic() - began - self._overhead_s, 0.01)
        self._samples_per_s = rows * one.width * spp / took_s
        return band

    def _band(
        self, one: PreparedScene, top: int, rows: int, spp: int, seed: int
    ) -> NDArray[np.float32]:
        """Return these rows of the film of a pass."""
        found = decode_layers(self._written(one, top, rows, spp, seed))
        return self._film(one, found, (rows, one.width), spp)

    def _written(self, one: PreparedScene, top: int, rows: int, spp: int, seed: int) -> bytes:
        """Return the EXR file that Blender writes of these rows of a pass, of means of samples."""
        render, cycles = one.scene.render, one.scene.cycles
        cycles.seed, cycles.sample_offset = divmod(seed, SEQUENCE_SAMPLES)
        cycles.sample_subset_length = spp
        # Counted from below, and a quarter of a pixel above the border: Blender rounds down.
        lowest = one.height - top - rows
        render.border_min_y = (lowest + 0.25) / one.height
        render.border_max_y = (lowest + rows + 0.25) / one.height
        render.filepath = f"/proc/self/fd/{self._file}"
        os.ftruncate(self._file, 0)
        with blender():
            # Of another scene of the file, if that is the one of the window.
            bpy.ops.render.render(write_still=True, scene=one.scene.name, layer=one.layer.name)
        return os.pread(self._file, os.fstat(self._file).st_size, 0)

    def _film(
        self, one: PreparedScene, found: dict[str, Any], shape: tuple[int, int], spp: int
    ) -> NDArray[np.float32]:
        """Return sums in the order of the film's channels, and ids. Cycles gives means.

        It draws samples from the reconstruction filter, so each has the weight 1.
        """
        assert self._passes is not None
        planes = [found[f"{one.layer.name}.Combined.{letter}"] * spp for letter in "RGB"]
        planes.append(np.full(shape, spp, np.float32))
        if one.has_alpha:
            planes.append(found[f"{one.layer.name}.Combined.A"] * spp)
        planes += self._passes.planes(found, spp)
        if planes[0].shape != shape:
            raise RuntimeError(f"a band of {shape} pixels came as one of {planes[0].shape}")
        film: NDArray[np.float32] = np.stack(planes, axis=-1).astype(np.float32, copy=False)
        return film
