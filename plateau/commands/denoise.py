"""`plateau denoise`: blends images that are already rendered with their denoised selves."""

import contextlib
import io
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from plateau.errors import CommandFailed
from plateau.farm.images.exr import Pixels, decode_image, decode_layers, encode_layers
from plateau.farm.wire import figures
from plateau.metric import Half, View, VisibleDifferences, estimate_from
from plateau.service.judging.denoised import Denoised, DenoisingTask, guides_in, layers_of
from plateau.service.monitor.denoising import oidn
from plateau.service.monitor.denoising.child import denoised

#: What images are said to be that do not say how many samples they have: as many as each other.
_ALIKE = 1.0


def denoise(images: Sequence[Path], out: Path, *, as_json: bool, **view: Any) -> None:
    """Denoise the mean of the images, write it, and print what is left to see if that is known.

    What is in `view` goes to `metric.View`.
    """
    if len(images) not in {2, 4}:
        raise CommandFailed(
            f"give two images or four, of as many samples each and independent, not {len(images)}"
        )
    if out.resolve() in {image.resolve() for image in images}:
        raise CommandFailed(f"-o {out} would overwrite an image that is read")
    if not oidn.is_installed():
        raise CommandFailed(oidn.MISSING)
    try:
        shown = View(**view)
    except ValueError as error:
        raise CommandFailed(str(error)) from error
    read = [_read(path) for path in images]
    sizes = {colour.shape[:2] for colour, _ in read}
    if len(sizes) > 1:
        sized = ", ".join(f"{width}×{height}" for height, width in sorted(sizes))
        raise CommandFailed(f"the images differ in size: {sized}")
    mean = np.asarray(np.mean([colour for colour, _ in read], axis=0), np.float32)
    each = [guides_in(layers) for _, layers in read]  # the mean, if all images have them
    guides = tuple(np.mean(alike, axis=0) for alike in zip(*each, strict=False))
    parts = tuple(Half(colour, _ALIKE) for colour, _ in read)
    found = denoised(DenoisingTask(mean, parts, guides, shown))
    _write(out, found, mean)
    left = _noise_left(found, shown)
    if as_json:
        print(json.dumps({"denoiser": found.denoiser, "guides": bool(guides), **left}))
        return
    print(f"{out}: {found.denoiser}")
    if left:
        pixels, share = figures.pixels(left["pixels"]), figures.percent(left["fraction"])
        print(f"noise left: {pixels} px ({share}), bias included")


def _read(path: Path) -> tuple[Pixels, dict[str, Pixels]]:
    """Return the colour of an EXR file, and its channels by name."""
    try:
        content = path.read_bytes()
        # OpenEXR prints its warnings, where scripts expect an answer.
        with contextlib.redirect_stdout(io.StringIO()):
            return decode_image(content), decode_layers(content)
    except OSError as error:
        raise CommandFailed(f"{path}: {error.strerror or error}") from error
    except ValueError as error:
        raise CommandFailed(f"{path}: {' '.join(str(error).split())}") from error


def _write(out: Path, found: Denoised, mean: Pixels) -> None:
    content = encode_layers(layers_of(found.blend, mean), {"plateau:denoiser": found.denoiser})
    try:
        out.write_bytes(content)
    except OSError as error:
        raise CommandFailed(f"{out}: {error.strerror or error}") from error


def _noise_left(found: Denoised, view: View) -> dict[str, float]:
    """Return how many pixels still differ visibly; nothing where only halves are known."""
    if found.error is None:
        return {}
    metric = VisibleDifferences(view)
    clean = metric.percept(found.error.likely.clean)
    left = estimate_from(metric, found.error.likely, clean)
    most = estimate_from(metric, found.error.greatest, clean)
    return {"pixels": left.pixels, "fraction": left.fraction, "most_pixels": most.pixels}
