"""The files of a set of results, which depend on the image and its facts alone."""

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plateau.farm.images.exr import Pixels, encode_layers, input_layer
from plateau.farm.images.png import encode_png
from plateau.farm.model.spec import JobSpec
from plateau.metric import Mask, encode_srgb
from plateau.metric.blend import Blend
from plateau.metric.non_finite import allowed_non_finite, non_finite_pixels
from plateau.metric.pictures import (
    MAP_PALETTE,
    SAMPLES_PALETTE,
    difference_map,
    heat_map,
    noise_map,
    non_finite_map,
    samples_map,
)
from plateau.picture.denoised import layers_of
from plateau.picture.facts import Facts, exr_header, png_texts
from plateau.picture.merged_image import MergedImage

#: The most pixels of a thumbnail's longer side.
LONGEST: Final = 192

_CAUSES: Final = (
    "an emitter whose radiance is NaN or infinite, or a texture or a material that divides by zero"
)


class NoiseMaps(NamedTuple):
    """Where noise is left to see; None where nobody knows it.

    That is so of a single slice, and of an image that cannot be a result.
    """

    visible: NDArray[np.float32] | None = None  #: as `Estimate.visible` has it
    heat: NDArray[np.float32] | None = None  #: by ColorVideoVDP, where a rule of the job goes by it


def result_files(
    merge: MergedImage,
    visible: Mask | None,
    noise: NoiseMaps,
    facts: Facts,
    spec: JobSpec,
    blend: Blend | None = None,
    *,
    compressed: bool,
) -> dict[str, bytes]:
    """Return the files by name.

    Parameters
    ----------
    merge
        The image.
    visible
        Where it differs visibly from the curve's first image, (height, width) bool; else None.
    noise
        Where noise is left to see, as `Judge.noise_maps` returns it.
    facts
        The metadata.
    spec
        The job's spec.
    blend
        The image blended with its denoised self, if it is to be.
    compressed
        Whether to compress the EXR as the spec says; this is slow.
    """
    image = merge.image() if blend is None else blend.seen
    exposure_ev = spec.view.exposure_ev
    spp_map = merge.spp_map()
    layers = merge.layers() if blend is None else _blended_layers(merge, blend)
    exact = ("Z", *merge.channels.exact)
    of_inputs = (f"{input_layer(spp)}.{one}" for spp in merge.inputs for one in exact)
    layers |= merge.input_layers() | (merge.variance_layers() if spec.variance else {})
    files = {
        "image.exr": encode_layers(
            layers if spp_map is None else {**layers, "spp": spp_map},
            {**exr_header(facts), **merge.header},
            precision=spec.exr.precision,
            compression=spec.exr.compression if compressed else "none",
            whole=("spp", *exact, *of_inputs, *(f"variance.{one}" for one in "RGB")),
        )
    }
    if not spec.pictures:
        return files
    picture = encode_srgb(image, exposure_ev)
    files |= {
        "image.png": encode_png(picture, texts=png_texts(facts)),
        "thumbnail.png": encode_png(thumbnail(image, exposure_ev)),
    }
    if not np.isfinite(image).all():
        files["non-finite.png"] = non_finite_png(image, exposure_ev)
    if spp_map is not None:
        files["spp.png"] = spp_png(spp_map, facts)
    if visible is not None:
        files["difference.png"] = encode_png(difference_map(picture, visible), MAP_PALETTE)
    if noise.visible is not None:
        files["noise.png"] = encode_png(noise_map(picture, noise.visible), MAP_PALETTE)
    if noise.heat is not None:
        files["quality.png"] = encode_png(heat_map(noise.heat), SAMPLES_PALETTE)
    return files


def _blended_layers(merge: MergedImage, blend: Blend) -> dict[str, Pixels]:
    layers = merge.layers()
    raw = np.stack([layers[name] for name in "RGB"], axis=-1)
    with np.errstate(invalid="ignore"):  # a scene may have infinite pixels
        return layers | layers_of(blend, raw, merge.image(as_seen=False) - raw)


def thumbnail(image: Pixels, exposure_ev: float) -> NDArray[np.uint8]:
    """Return a small (height, width, 3) uint8 sRGB picture of a linear image.

    Radiance is averaged before it is encoded, so the thumbnail is as bright as the image.

    Parameters
    ----------
    image
        (height, width, 3) float32 linear radiance; NaN and infinities count as black.
    exposure_ev
        The exposure in stops, as in `metric.encode_srgb`.
    """
    factor = -(-max(image.shape[:2]) // LONGEST)
    if factor > 1:
        image = _block_means(np.where(np.isfinite(image), image, 0), factor)
    return encode_srgb(image, exposure_ev)


def _block_means(image: NDArray[Any], factor: int) -> Pixels:
    """Return the means of blocks of factor × factor pixels; the last blocks may be smaller."""
    for axis in (0, 1):
        starts = np.arange(0, image.shape[axis], factor)
        sizes = np.diff([*starts, image.shape[axis]])
        shape = [1, 1, 1]
        shape[axis] = -1
        image = np.add.reduceat(image, starts, axis=axis) / sizes.reshape(shape)
    return image.astype(np.float32)


def spp_png(spp_map: Pixels, facts: Facts) -> bytes:
    """Return a PNG of the samples of each pixel; text chunks have the fewest and the most."""
    scale = {"plateau:spp_min": f"{spp_map.min():.0f}", "plateau:spp_max": f"{spp_map.max():.0f}"}
    return encode_png(samples_map(spp_map), SAMPLES_PALETTE, {**png_texts(facts), **scale})


def non_finite_png(image: Pixels, exposure_ev: float) -> bytes:
    """Return a PNG that marks NaN and infinite pixels on the image in dim grey."""
    codes = non_finite_map(encode_srgb(image, exposure_ev), non_finite_pixels(image))
    return encode_png(codes, MAP_PALETTE)


def flaw_of(image: Pixels) -> str | None:
    """Return why a (height, width, 3) float32 image cannot be a result; None if it can.

    More samples do not help: a sum that is NaN or infinite stays so.
    """
    found = non_finite_pixels(image)
    allowed = allowed_non_finite(found.nan.size)
    if found.count <= allowed:
        return None
    return (
        f"{found.in_words()}, at most {allowed:,} may be, and more samples repair none: look where "
        f"non-finite.png marks them for {_CAUSES}, mend the scene, and render it again"
    )
