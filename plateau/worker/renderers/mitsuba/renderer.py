"""Hosts Mitsuba, in the render child alone: loads one scene at a time and renders its passes."""

import gc
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from plateau.farm.model.slices.zones import Zone, pixels_of
from plateau.worker.renderers.canary import Canary, CanaryWrong, known_sphere
from plateau.worker.renderers.contract import Load, Loaded, SceneError
from plateau.worker.renderers.mitsuba.kernel import LANES_OF_DR_JIT, Kernel, share_out
from plateau.worker.renderers.mitsuba.mitsuba_words import scene_errors
from plateau.worker.renderers.mitsuba.scene_prep import PreparedScene, prepare, with_aovs
from plateau.worker.renderers.mitsuba.scene_update import updated

NO_EMITTER: Final = 'the scene has no emitter; add one, such as <emitter type="constant"/>'
#: Rays of the camera that are looked at, along each axis of its film.
_RAYS: Final = 8

_CANARY = "canary.xml"
_CANARY_SPP = 64
_LUMINANCE = (0.2126, 0.7152, 0.0722)  # of Rec. 709, which is all that mono variants know


class Renderer:
    """Mitsuba as `plateau.worker.renderers.contract.Renderer` has it.

    A process can only ever use one variant. LLVM is loaded from ``DRJIT_LIBLLVM_PATH``.
    """

    def __init__(self, variant: str, threads: int) -> None:
        mi.set_variant(variant)
        mi.set_log_level(mi.LogLevel.Warn)  # of good scenes it says nothing
        dr.set_thread_count(threads)
        self._variant = variant
        self._prepared: PreparedScene | None = None
        self._request: Load | None = None  # of that scene
        self._kernel: Kernel | None = None

    def probe(self) -> Canary:
        """Render a Cornell box, which takes more of LLVM, and then a known image."""
        box = mi.cornell_box()
        box["sensor"]["film"].update(width=16, height=16)
        image = np.array(mi.render(mi.load_dict(box), spp=4, seed=1))
        if not (np.isfinite(image).all() and image.mean() > 0):
            raise CanaryWrong("an image is black or not finite")
        folder = Path(__file__).parent
        self.load(Load(folder=str(folder), entry=_CANARY, parameters={}))
        (film,) = self.render([(_CANARY_SPP, 1)], is_cancelled=lambda: False)
        weights = _LUMINANCE if "mono" in self._variant else None
        truth = known_sphere(film.shape[0], weights)
        return Canary(film=film, truth=truth, spp=_CANARY_SPP)

    def load(self, request: Load) -> Loaded:
        """Load a scene in the place of the one before; errors carry Mitsuba's message."""
        share_out(LANES_OF_DR_JIT)
        # A scene may take minutes to load, and the frames of a sequence differ little.
        before, self._request = self._request, None
        if self._prepared is not None and _differ_in_parameters_alone(before, request):
            one = updated(self._variant, self._prepared, request)
            if one is not None:
                self._prepared, self._request = one, request
                return self._loaded(one)
        kept = self._prepared if _differ_in_aovs_alone(before, request) else None
        self._unload()
        if kept is None:
            one = prepare(self._variant, request)
        else:
            one = with_aovs(self._variant, kept, request)
        self._prepared, self._request = one, request
        if not self._variant.startswith("scalar"):
            self._kernel = Kernel(one)
        return self._loaded(one)

    def _loaded(self, one: PreparedScene) -> Loaded:
        return Loaded(
            width=one.width,
            height=one.height,
            channels=one.channels.names,
            ids=one.channels.ids,
            border=0 if self._kernel is None else self._kernel.border,
            notes=one.notes,
            header=one.header,
        )

    def render(
        self,
        passes: Iterable[tuple[int, int]],
        *,
        zones: Sequence[Zone] = (),
        is_cancelled: Callable[[], bool],
    ) -> Iterator[NDArray[np.float32]]:
        """Yield the film of each pass, in order, before it is divided by its weights."""
        if self._prepared is None:
            raise RuntimeError("no scene is loaded")
        if self._kernel is not None:
            yield from self._kernel.films(passes, zones, is_cancelled)
            return
        if zones:
            raise SceneError(f"the variant {self._variant} renders whole films, and no zones")
        for spp, seed in passes:
            if is_cancelled():
                return
            yield _rendered(self._prepared, spp, seed)

    def why_black(self, zones: Sequence[Zone]) -> str:
        """Return why a film of the loaded scene is black; see `KnowsBlack`."""
        assert self._prepared is not None
        one = self._prepared
        # A zone may be black beside one that is not: a depth is no light, and volumes may shine.
        is_whole = not zones or pixels_of(zones) == one.width * one.height
        if is_whole and not one.channels.aovs and not one.scene.emitters():
            raise SceneError(f"the image is black: {NO_EMITTER}")
        return why_black(one.scene, one.sensor)

    def _unload(self) -> None:
        """Free the scene before, so that two never share the memory."""
        self._prepared = self._kernel = self._request = None
        gc.collect()
        dr.flush_malloc_cache()


def _differ_in_aovs_alone(one: Load | None, other: Load) -> bool:
    if one is None or one.aovs == other.aovs:
        return False
    return one == replace(other, id=one.id, aovs=one.aovs)


def _differ_in_parameters_alone(one: Load | None, other: Load) -> bool:
    return one is not None and one == replace(other, id=one.id, parameters=one.parameters)


def _rendered(one: PreparedScene, spp: int, seed: int) -> NDArray[np.float32]:
    """Return the film of a pass that Mitsuba renders by itself, as scalar variants do."""
    if spp < 1 or spp & (spp - 1):
        raise ValueError(f"a pass of a scalar variant has a power of two of spp, not {spp}")
    with scene_errors():
        # Mitsuba prepares (and so clears) the film and reseeds the sampler in each call: nothing of
        # a pass is left to the next.
        one.integrator.render(one.scene, one.sensor, seed=seed, spp=spp, develop=False)
        film: NDArray[np.float32] = np.array(one.film.develop(raw=True))
    alpha = 3  # Mitsuba has it before W
    order = [0, 1, 2, alpha + 1, alpha] if one.channels.has_alpha else [0, 1, 2, alpha]
    return film[..., [*order, *(len(order) + index for index in one.channels.aovs)]]


def why_black(scene: Any, sensor: Any) -> str:
    """Return a note on an image without any light: why, as far as the scene shows it."""
    why = "look whether the emitters are too weak, turned away, or hidden by a shape"
    with suppress(Exception):  # a sensor or a shape of an unusual kind
        if not scene.emitters():
            why = NO_EMITTER
        elif _sees_backs_alone(scene, sensor):
            why = (
                "all that the camera sees are backs of surfaces, which reflect nothing: it may be "
                "inside a shape"
            )
    return f"the image is black, since no light arrived: {why}"


def _sees_backs_alone(scene: Any, sensor: Any) -> bool:
    places = (np.arange(_RAYS) + 0.5) / _RAYS
    x, y = (axis.ravel() for axis in np.meshgrid(places, places))
    if dr.is_jit_v(mi.Float):
        return _of_backs(scene, sensor, mi.Point2f(x, y))
    return all(_of_backs(scene, sensor, mi.Point2f(*place)) for place in zip(x, y, strict=True))


def _of_backs(scene: Any, sensor: Any, places: Any) -> bool:
    ray, _ = sensor.sample_ray(0.0, 0.5, places, mi.Point2f(0.5, 0.5))
    found = scene.ray_intersect(ray)
    if not dr.all(found.is_valid()):
        return False
    flags = mi.BSDFFlags
    lit = int(flags.BackSide) | int(flags.Null) | int(flags.Transmission)
    is_back = dr.dot(found.n, ray.d) > 0
    return bool(dr.all(is_back & ((found.bsdf(ray).flags() & lit) == 0)))
