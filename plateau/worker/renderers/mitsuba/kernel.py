"""The pass kernel of Mitsuba's JIT variants: samples of any pixels, summed without a race.

Mitsuba's own `render` adds samples to the film by atomic operations, in the order in which threads
come: the last bits of its sums are up to chance. Here a lane is one sample. Its random numbers
depend on the pass's seed, its pixel and its number in the pixel. The samples of a pixel are added
in the order of their numbers, and what they give to other pixels in the order of rows and of the
filter's taps. So no bit depends on the number of threads, on the *chunks* of rows in which a pass
is rendered, or on what else a chunk has. Part of the render child: imports Mitsuba, whose variant
has to be set.
"""

from __future__ import annotations

import ctypes
import math
import time
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple, TypeAlias

import drjit as dr
import mitsuba as mi

from plateau.worker.renderers.mitsuba.mitsuba_words import scene_errors
from plateau.worker.renderers.mitsuba.pass_film import PassFilm

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from plateau.farm.model.slices.zones import Zone
    from plateau.worker.renderers.mitsuba.pass_film import Band
    from plateau.worker.renderers.mitsuba.scene_prep import PreparedScene

Array: TypeAlias = "NDArray[np.float32]"

#: Samples of the first chunk, of the smallest, and of the largest.
_FIRST_CHUNK: Final = 2**19
_SMALLEST_CHUNK: Final = 2**16
_LARGEST_CHUNK: Final = 2**22
#: Sums of a chunk, over its pixels, channels and taps of the filter: some 130 MB.
_LARGEST_SUMS: Final = 2**25
#: Seconds that a chunk may take before the next ones are smaller: a cancel waits for its end.
_CHUNK_S: Final = 0.8

#: Lanes that a thread takes at a time; of more, a chunk has few such shares, and ends late.
_LANES: Final = 2**11
LANES_OF_DR_JIT: Final = 2**14  #: while a scene is loaded: last bits of its sums depend on it

#: Rounds of the Tiny Encryption Algorithm that make a lane's random numbers of its seed and key.
#: Any number of rounds keeps lanes apart; 4, as Mitsuba's samplers have, mixes few bits.
_TEA_ROUNDS: Final = 8

#: Channels that one loop over a pixel's samples filters: it keeps a sum of each for every tap.
_FILTERED_AT_ONCE: Final = 4


@cache
def _lane_sampler() -> type:
    """Return the class of the samplers; it can only be made once Mitsuba has its variant."""

    class LaneSampler(mi.Sampler):
        """Independent samples; each lane's are those of its key, wherever it stands."""

        def __init__(self, seed: Any, keys: Any) -> None:
            super().__init__(mi.Properties())
            state, stream = mi.sample_tea_32(seed, keys, _TEA_ROUNDS)
            self.rng: Any = mi.PCG32()  # type: ignore[operator]  # whose stub is an object
            self.rng.seed(mi.UInt64(state), mi.UInt64(stream))

        def next_1d(self, active: Any = True) -> Any:
            return self.rng.next_float32(active)

        def next_2d(self, active: Any = True) -> Any:
            first = self.next_1d(active)
            return mi.Point2f(first, self.next_1d(active))

    return LaneSampler


class Kernel:
    """Renders passes of one scene.

    Parameters
    ----------
    one : PreparedScene
        What is rendered; nothing of it may change while the kernel is used.
    """

    def __init__(self, one: PreparedScene) -> None:
        self._one = one
        self._filter = one.film.rfilter()
        #: Pixels to each side to which a sample contributes beyond its own.
        self.border = 0 if self._filter.is_box_filter() else math.ceil(self._filter.radius() - 0.5)
        # Traced once and replayed from then on: to trace takes 5 to 200 ms.
        self._recorded: Callable[..., Any] = dr.freeze(
            self._sums, state_fn=lambda *_, **__: (one.scene, one.sensor, one.integrator)
        )
        self._samples = _FIRST_CHUNK

    def films(
        self,
        passes: Iterable[tuple[int, int]],
        zones: Sequence[Zone],
        is_cancelled: Callable[[], bool],
    ) -> Iterator[Array]:
        """Yield the film of each pass, as `plateau.worker.renderers.contract.Renderer.render` does.

        The next chunk already renders while the one before is added to its film. It is not begun
        sooner: Dr.Jit takes nothing back.
        """
        before: _Rendered | None = None
        for film, bands, spp, seed in self._chunks(passes, zones, is_cancelled):
            began, pixels = time.monotonic(), film.pixels(bands)
            begun = self._begin(pixels, spp, seed)
            if before is not None:
                yield from before.added()
            before = _Rendered(film, bands, *_waited_for(begun))
            self._adjust((time.monotonic() - began) / (spp * pixels.size))
        if before is not None:
            yield from before.added()

    def _chunks(
        self,
        passes: Iterable[tuple[int, int]],
        zones: Sequence[Zone],
        is_cancelled: Callable[[], bool],
    ) -> Iterator[tuple[PassFilm, list[Band], int, int]]:
        sums_of_pixel = (2 * self.border + 1) ** 2 * len(self._one.channels.names)
        for spp, seed in passes:
            film = PassFilm(self._one, self.border, zones)
            while not film.is_begun:
                if is_cancelled():
                    return
                pixels = min(self._samples // spp, _LARGEST_SUMS // sums_of_pixel)
                yield film, film.next_bands(pixels), spp, seed

    def _adjust(self, sample_s: float) -> None:
        """Choose the size of the next chunks by the seconds that a sample of the last took."""
        whole_s = self._samples * sample_s  # the last may have been smaller
        if whole_s > _CHUNK_S:
            self._samples = max(self._samples * 2 // 3, _SMALLEST_CHUNK)
        elif whole_s * 3 < _CHUNK_S * 2:
            self._samples = min(self._samples * 3 // 2, _LARGEST_CHUNK)

    def _begin(self, pixels: NDArray[np.uint32], spp: int, seed: int) -> Any:
        """Begin to render these pixels of the film; return the sums to be."""
        # Opaque, one kernel serves every seed and spp. A recording takes its arguments' sizes.
        opaque_spp = dr.opaque(mi.UInt32, spp)
        lane = dr.arange(mi.UInt32, pixels.size * spp)
        place = lane // opaque_spp
        pixel = dr.gather(mi.UInt32, mi.UInt32(pixels), place)
        key = pixel * opaque_spp + (lane - place * opaque_spp)
        first = dr.arange(mi.UInt32, pixels.size) * opaque_spp
        arguments = pixel, key, first, mi.UInt32(seed), opaque_spp, mi.Float(1 / math.sqrt(spp))
        dr.make_opaque(arguments)
        share_out(_LANES)
        with scene_errors():
            try:
                sums = self._recorded(*arguments)
            except RuntimeError:
                # Dr.Jit cannot record what some plugins do (the thin lens is one).
                self._recorded = self._sums
                sums = self._sums(*arguments)
            dr.eval(sums)  # waits for nothing
        return sums

    def _sums(
        self, pixel: Any, key: Any, first: Any, seed: Any, spp: Any, spacing: Any
    ) -> tuple[list[list[Any]], list[Any]]:
        """Return each pixel's sums, for each tap of the filter; and its ids.

        Random numbers depend on a lane's key and the pass's seed. `first` is the lane of each
        pixel's first sample, `spacing` that of its samples in pixels.
        """
        one = self._one
        sampler = _lane_sampler()(seed, key)
        y = pixel // one.width
        within = sampler.next_2d()
        values = self._sampled(sampler, mi.Point2f(pixel - y * one.width, y) + within, spacing)
        # Now, and once: each sum of its own would trace the path again.
        dr.eval(values, within)
        summed = [values[index] for index in one.channels.summed]
        ids = [dr.gather(mi.Float, values[index], first) for index in one.channels.of_ids]
        return self._filtered(summed, within, first, spp), ids

    def _sampled(self, sampler: Any, place: Any, spacing: Any) -> list[Any]:
        """Return the channels of one sample at each of these places, as they stand in the film."""
        one, sensor = self._one, self._one.sensor
        moment = mi.Float(sensor.shutter_open())
        if sensor.shutter_open_time() > 0:
            moment += sampler.next_1d() * sensor.shutter_open_time()
        wavelength = sampler.next_1d() if mi.is_spectral else mi.Float(0)
        aperture = sampler.next_2d() if sensor.needs_aperture_sample() else mi.Point2f(0.5)
        on_film = place / mi.ScalarVector2f(one.width, one.height)
        ray, importance = sensor.sample_ray_differential(moment, wavelength, on_film, aperture)
        ray.scale_differential(spacing)
        radiance, hit, aovs = one.integrator.sample(
            one.scene, sampler, ray, sensor.get_medium(), True
        )
        colour: Any = mi.unpolarized_spectrum(importance * radiance)
        if mi.is_spectral:
            colour = mi.spectrum_to_srgb(colour, ray.wavelengths)
        elif mi.is_monochromatic:
            colour = colour.x
        weight = dr.ones(mi.Float, dr.width(place))
        alpha = [dr.select(hit, mi.Float(1), mi.Float(0))] if one.channels.has_alpha else []
        return [*mi.Color3f(colour), weight, *alpha, *(aovs[index] for index in one.channels.aovs)]

    def _filtered(self, values: list[Any], within: Any, first: Any, spp: Any) -> list[list[Any]]:
        """Return what the samples of each pixel give to the pixels around it, tap by tap."""
        sums: list[list[Any]] = [[] for _ in range((2 * self.border + 1) ** 2)]

        def under_way(number: Any, _sums: object) -> Any:
            return number < spp

        for start in range(0, len(values), _FILTERED_AT_ONCE):
            group = values[start : start + _FILTERED_AT_ONCE]

            def add(number: Any, before: list[list[Any]], group: list[Any] = group) -> Any:
                lane = first + number
                here = [dr.gather(mi.Float, value, lane) for value in group]
                weights = self._weights(within, lane)
                after = [
                    [total + weight * value for total, value in zip(totals, here, strict=True)]
                    for totals, weight in zip(before, weights, strict=True)
                ]
                return number + 1, after

            zeros = [[dr.zeros(mi.Float, dr.width(first)) for _ in group] for _ in sums]
            begin = dr.zeros(mi.UInt32, dr.width(first)), zeros
            _, of_group = dr.while_loop(begin, under_way, add)
            for tap, totals in zip(sums, of_group, strict=True):
                tap += totals
        return sums

    def _weights(self, within: Any, lane: Any) -> list[Any]:
        """Return the filter's weights of one sample of each pixel, tap by tap."""
        if not self.border:
            return [1]
        taps = range(-self.border, self.border + 1)
        x, y = (dr.gather(mi.Float, axis, lane) - 0.5 for axis in within)
        across, down = ([self._filter.eval(tap - at) for tap in taps] for at in (x, y))
        return [wide * high for high in down for wide in across]


def share_out(lanes: int) -> None:
    """Let Dr.Jit's threads take so many lanes at a time, for which it has no Python name."""
    with suppress(AttributeError, OSError, StopIteration):  # of another version
        core = ctypes.CDLL(str(next(Path(dr.__file__).parent.glob("libdrjit-core.*"))))
        core._Z23jit_llvm_set_block_sizej(lanes)


def _waited_for(begun: Any) -> tuple[list[list[Array]], list[Array]]:
    """Return the sums and the ids of a chunk once they are there, without a copy where they lie."""
    sums, ids = begun
    with scene_errors():
        return [[one.numpy() for one in tap] for tap in sums], [one.numpy() for one in ids]


class _Rendered(NamedTuple):
    """A chunk that is rendered and not yet part of its film."""

    film: PassFilm
    bands: list[Band]
    sums: list[list[Array]]
    ids: list[Array]

    def added(self) -> Iterator[Array]:
        """Add the chunk to its film; yield that if it is whole."""
        self.film.add(self.bands, self.sums, self.ids)
        if self.film.is_whole:
            yield self.film.pixels_of_zones()
