"""Which pixels of two image files an eye can tell apart.

>>> from plateau.picture.diff import compare_files
>>> comparison = compare_files(Path("a.png"), Path("b.png"))  # doctest: +SKIP
>>> comparison.in_words()  # doctest: +SKIP
'1,234 of 65,536 pixels (1.9 %) differ visibly'
"""

import contextlib
import io
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from plateau.errors import needs
from plateau.farm.images.exr import decode_image
from plateau.farm.images.png import decode_png, encode_png
from plateau.metric import Image, Mask, View, VisibleDifferences, encode_srgb
from plateau.metric.display import displayed, finite_pixels
from plateau.metric.pictures import MAP_PALETTE, SAMPLES_PALETTE, difference_map, heat_map
from plateau.metric.vdp import Difference

if TYPE_CHECKING:
    from plateau.metric.cvvdp.model import Quality


class CannotCompare(Exception):
    """The files cannot be compared; the message says why, in one line."""


@dataclass(frozen=True)
class FileKind:
    """A format of image files, known by how they begin."""

    name: str
    signature: bytes
    #: The view's gamma where none is given: the power from the file's values to linear light.
    gamma: float


#: Code values over the largest, and linear radiance.
PNG: Final = FileKind("PNG", b"\x89PNG\r\n\x1a\n", 2.2)
EXR: Final = FileKind("EXR", b"v/1\x01", 1.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Comparison:
    """Two images, compared under one view."""

    #: How both were shown and seen, gamma included.
    view: View
    difference: Difference
    #: What the screen showed of the test image: (H, W, 3) float32 linear light in [0, 1].
    shown: Image
    #: Column and row of the first pixel that is NaN or infinite in either; None where none is.
    non_finite_at: tuple[int, int] | None
    #: By ColorVideoVDP, with its map; None where that was not asked.
    quality: "Quality | None" = None

    def as_json(self) -> dict[str, Any]:
        """The result as JSON values."""
        height, width = self.shown.shape[:2]
        return {
            "visible_pixels": self.difference.count,
            "visible_fraction": self.difference.fraction,
            "non_finite_pixels": self.difference.non_finite,
            "non_finite_at": self.non_finite_at,
            "width": width,
            "height": height,
            "view": asdict(self.view),
            **({} if self.quality is None else {"jod": self.quality.jod}),
        }

    def in_words(self) -> str:
        """The result as a sentence."""
        height, width = self.shown.shape[:2]
        count, total = self.difference.count, width * height
        noun, verb = "pixel" if total == 1 else "pixels", "differs" if count == 1 else "differ"
        words = f"{count:,} of {total:,} {noun} ({share(count, total)}) {verb} visibly"
        lost = self.difference.non_finite
        if lost:
            words += f"; {lost:,} of them {'is' if lost == 1 else 'are'} NaN or infinite"
            words += "" if self.non_finite_at is None else f", the first at {self.non_finite_at}"
        return words if self.quality is None else f"{words}\n{self.quality.jod:.2f} JOD"

    def write_map(self, path: Path) -> None:
        """Write the visible pixels, marked on the test image in dim grey, as a PNG file."""
        codes = difference_map(encode_srgb(self.shown), self.difference.visible)
        path.write_bytes(encode_png(codes, MAP_PALETTE))

    def write_heat(self, path: Path) -> None:
        """Write where a person would see the errors by ColorVideoVDP, as a PNG file."""
        assert self.quality is not None
        assert self.quality.heat is not None
        path.write_bytes(encode_png(heat_map(self.quality.heat), SAMPLES_PALETTE))


def compare_files(
    reference: Path,
    test: Path,
    view: View | None = None,
    *,
    gamma: float | None = None,
    layer: str | None = None,
    jod: bool = False,
) -> Comparison:
    """Compare two PNG or two EXR files, as both would be seen on the same screen.

    Transparent pixels are laid over black.

    Parameters
    ----------
    reference, test
        The files, of one kind and size. Which is which changes no count.
    view
        How they are shown and seen, but for its gamma.
    gamma
        Power from the files' values to linear light; None for that of their kind: 2.2 for PNG,
        1 for EXR. Colour profiles and other such notes in the files are not read.
    layer
        Of EXR files; None for their plain R, G and B.
    jod
        Whether to compare them by ColorVideoVDP too, whose kernels compile for some 15 s once.
        Pixels that are not finite in either image count as equal.

    Raises
    ------
    CannotCompare
        A file cannot be read, or the two are not of one kind and size.
    """
    contents = {path: _content(path) for path in (reference, test)}
    kinds = {path: _kind(path, content) for path, content in contents.items()}
    if kinds[reference] != kinds[test]:
        raise CannotCompare(
            f"{reference} is {kinds[reference].name} and {test} is {kinds[test].name}, which a "
            "screen shows differently: save both as one or the other"
        )
    kind = kinds[reference]
    view = replace(view or View(), gamma=kind.gamma if gamma is None else gamma)
    ours, theirs = (
        _decoded(path, kind, contents[path], view.gamma, layer) for path in (reference, test)
    )
    metric = VisibleDifferences(view)
    try:
        difference = metric.compare(metric.percept(ours), metric.percept(theirs))
    except ValueError as error:
        raise CannotCompare(str(error)) from error
    finite = finite_pixels(ours) & finite_pixels(theirs)
    lost = np.argwhere(~finite)
    return Comparison(
        view=view,
        difference=difference,
        shown=displayed(theirs, view),
        non_finite_at=(int(lost[0][1]), int(lost[0][0])) if lost.size else None,
        quality=_quality(ours, theirs, finite, view) if jod else None,
    )


def _quality(ours: Image, theirs: Image, finite: Mask, view: View) -> "Quality":
    with needs("monitor"):
        from plateau.metric.cvvdp import ColorVideoVDP
        from plateau.metric.quality import display_of

    eye = ColorVideoVDP(display_of(view, ours.shape[1]))
    try:
        reference, test = (
            eye.percept(displayed(np.where(finite[..., np.newaxis], image, 0), view))
            for image in (ours, theirs)
        )
    except ValueError as error:
        raise CannotCompare(str(error)) from error
    return eye.compare(reference, test, heat=True)


def _content(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise CannotCompare(f"{path}: {error.strerror or error}") from error


def _kind(path: Path, content: bytes) -> FileKind:
    kind = next((kind for kind in (PNG, EXR) if content.startswith(kind.signature)), None)
    if kind is None:
        raise CannotCompare(f"{path} is neither a PNG nor an EXR file")
    return kind


def _decoded(path: Path, kind: FileKind, content: bytes, gamma: float, layer: str | None) -> Image:
    """Return the file's image, (H, W, 3) float32, laid over black where it is transparent."""
    try:
        if kind is EXR:
            # OpenEXR prints its warnings, where scripts expect an answer; an error follows them.
            with contextlib.redirect_stdout(io.StringIO()):
                return decode_image(content, layer)
        if layer is not None:
            raise ValueError("--layer is for EXR files")
        values = decode_png(content)
    except Exception as error:
        # Of a damaged file the codecs raise what they like.
        words = " ".join(str(error).split())
        raise CannotCompare(f"{path}, as {kind.name}: {words}") from error
    if values.alpha is None:
        return values.colour
    # So that linear light, the power gamma of it, is multiplied by alpha.
    over_black: Image = values.colour * (values.alpha ** (1 / gamma))[..., np.newaxis]
    return over_black


def share(count: int, total: int) -> str:
    """Return a count's share of the total in per cent, which says 0 or 100 only where it is.

    Examples
    --------
    >>> share(0, 1000), share(1, 100_000), share(19, 1000), share(999_999, 1_000_000)
    ('0 %', 'under 0.1 %', '1.9 %', 'over 99.9 %')
    """
    percent = 100 * count / total
    if count in {0, total}:
        return f"{percent:.0f} %"
    if percent < 0.1:
        return "under 0.1 %"
    if percent > 99.9:
        return "over 99.9 %"
    return f"{percent:.1f} %"
