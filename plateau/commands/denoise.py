"""`plateau denoise`: blends images that are already rendered with their denoised selves."""

import contextlib
import io
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from plateau.commands import options as o
from plateau.commands.app import app
from plateau.commands.options.spec_fields import view_of_place
from plateau.commands.printing import print_json
from plateau.errors import CommandFailed

if TYPE_CHECKING:
    from plateau.farm.images.exr import Pixels
    from plateau.metric import Half, View
    from plateau.picture.denoised import Denoised


@app.command()
def denoise(
    images: Annotated[
        list[Path], typer.Argument(help="Two EXR files or more, of as many samples each.")
    ],
    out: Annotated[Path, typer.Option("--out", "-o", metavar="OUT.exr", help="File to write.")],
    seen: o.Seen = None,
    exposure: Annotated[float, typer.Option(help="Exposure in EV.")] = 0.0,
    as_json: o.Json = False,
) -> None:
    """Denoise the mean of renders of one scene, where that is nearer to the truth.

    The images are of any renderer, each with samples of its own (other seeds). They say how
    far the denoiser can be trusted at each pixel, and how many pixels of the result still differ
    visibly from the converged image. Where all have the channels albedo.R, .G, .B and N.X, .Y, .Z,
    these guide the denoiser.

    For example:
      plateau denoise seed1.exr seed2.exr -o clean.exr
      plateau denoise a.exr b.exr c.exr d.exr -o clean.exr --exposure 1

    OUT.exr has the blend as R, G and B, and beside it raw.*, denoised.* and denoised.weight, the
    share of the denoised image.
    """
    if len(images) < 2:
        raise CommandFailed("give two images or more, of as many samples each and independent")
    if out.resolve() in {image.resolve() for image in images}:
        raise CommandFailed(f"-o {out} would overwrite an image that is read")

    from plateau.files.job_folder import whole
    from plateau.metric import View
    from plateau.picture.denoising import oidn

    if not oidn.is_installed():
        raise CommandFailed(oidn.MISSING)
    try:
        shown = View(**view_of_place(seen), exposure_ev=exposure)
    except ValueError as error:
        raise CommandFailed(str(error)) from error
    try:
        with whole(out) as unfinished:
            _denoise(images, out, unfinished, shown, as_json=as_json)
    except OSError as error:
        raise CommandFailed(f"{out}: {error.strerror or error}") from error


def _denoise(
    images: Sequence[Path], out: Path, unfinished: Path, shown: "View", *, as_json: bool
) -> None:
    import numpy as np

    from plateau.farm.images.exr import encode_layers
    from plateau.farm.wire import figures
    from plateau.metric import allowed_non_finite, non_finite_pixels
    from plateau.picture.denoised import DenoisingTask, guides_in, layers_of
    from plateau.picture.denoising.child import denoised
    from plateau.picture.independence import Independence

    read = [_read(path) for path in images]
    sizes = {one.colour.shape[:2] for one in read}
    if len(sizes) > 1:
        sized = ", ".join(f"{width}×{height}" for height, width in sorted(sizes))
        raise CommandFailed(f"the images differ in size: {sized}")
    if len({str(one.place) for one in read}) > 1:
        raise CommandFailed("the images are crops of different parts of a film")
    independence = Independence()
    for path, one in zip(images, read, strict=True):
        independence.add(str(path), one.colour, one.job)
    halves = _mean(read[::2]), _mean(read[1::2])
    mean = _mean(read).mean
    lost = {path: non_finite_pixels(one.colour) for path, one in zip(images, read, strict=True)}
    lost = {path: one for path, one in lost.items() if one.count}
    bad = "; ".join(f"{path}: {one.in_words()}" for path, one in lost.items())
    if non_finite_pixels(mean).count > allowed_non_finite(mean[..., 0].size):
        raise CommandFailed(f"{bad}: at most {allowed_non_finite(mean[..., 0].size):,} may be")
    each = [guides_in(one.layers) for one in read]  # the mean, if all images have them
    guides = tuple(np.mean(alike, axis=0) for alike in zip(*each, strict=False))
    found = denoised(DenoisingTask(mean, halves, guides, shown))
    attributes = {"plateau:denoiser": found.denoiser, **read[0].place}
    unfinished.write_bytes(encode_layers(layers_of(found.blend, mean), attributes))
    left = _noise_left(found, shown)
    if as_json:
        about = {"denoiser": found.denoiser, "guides": bool(guides)}
        print_json({**about, **left, "non_finite_pixels": non_finite_pixels(mean).count})
        return
    print(f"{out}: {found.denoiser}")
    pixels, share = figures.pixels(left["pixels"]), figures.percent(left["fraction"])
    words = f"noise left: {pixels} px ({share}), bias included"
    if left["undetermined"]:
        words += f"; undetermined: it may be {figures.pixels(left['most_pixels'])} px"
    print(words)
    if bad:
        print(f"left out: {bad}")


class _Image(NamedTuple):
    colour: "Pixels"
    layers: "dict[str, Pixels]"
    job: str | None  #: of Plateau's, where one made it
    place: dict[str, Any]  #: of a crop, in its film


def _mean(images: Sequence[_Image]) -> "Half":
    """Return the mean of these images, each of one sample: nobody knows how many it has."""
    import numpy as np

    from plateau.metric import Half

    mean = np.mean([one.colour for one in images], axis=0)
    return Half(np.asarray(mean, np.float32), len(images))


def _read(path: Path) -> _Image:
    """Return the colour of an EXR file, its channels by name, and its job."""
    from plateau.farm.images.crops import CROP
    from plateau.farm.images.exr import decode_header, decode_image, decode_layers

    try:
        content = path.read_bytes()
        # OpenEXR prints its warnings, where scripts expect an answer.
        with contextlib.redirect_stdout(io.StringIO()):
            header = decode_header(content)
            place = {CROP: header[CROP]} if CROP in header else {}
            job = header.get("plateau:job")
            return _Image(decode_image(content), decode_layers(content), job, place)
    except OSError as error:
        raise CommandFailed(f"{path}: {error.strerror or error}") from error
    except ValueError as error:
        raise CommandFailed(f"{path}: {' '.join(str(error).split())}") from error


def _noise_left(found: "Denoised", view: "View") -> dict[str, Any]:
    """Return how many pixels still differ visibly."""
    from plateau.metric import Evidence, Visible, VisibleDifferences, allowed_pixels

    evidence = Evidence(1, found.blend.image, None, VisibleDifferences(view), found.error)
    left = evidence.estimate
    assert left is not None
    allowed = allowed_pixels(Visible().target, evidence.pixels)
    return {
        "pixels": left.pixels,
        "fraction": left.fraction,
        "most_pixels": left.greatest_pixels,
        "undetermined": not left.is_determined(allowed),
    }
