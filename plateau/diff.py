"""Which pixels of two image files an eye can tell apart.

>>> from plateau.diff import compare_files
>>> comparison = compare_files(Path("a.png"), Path("b.png"))  # doctest: +SKIP
>>> comparison.in_words()  # doctest: +SKIP
'1,234 of 65,536 pixels (1.9 %) differ visibly'
"""

import contextlib
import io
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from farm.exr import decode_image
from farm.png import decode_png, encode_png
from metric import Difference, Image, View, VisibleDifferences, difference_picture
from metric.display import displayed


class CannotCompare(Exception):
    """The files cannot be compared; the message says why, in one line."""


def _png_values(content: bytes) -> Image:
    values: Image = decode_png(content).astype(np.float32)
    values /= 255
    return values


@dataclass(frozen=True)
class FileKind:
    """A format of image files, known by how they begin."""

    name: str
    signature: bytes
    #: The view's gamma where none is given: the power from the file's values to linear light.
    gamma: float
    #: (H, W, 3) float32 of a file's content; ValueError where it holds no such image.
    decode: Callable[[bytes], Image]


#: 8-bit code values over 255, and linear radiance.
KINDS: Final = (
    FileKind("PNG", b"\x89PNG\r\n\x1a\n", 2.2, _png_values),
    FileKind("EXR", b"v/1\x01", 1.0, decode_image),
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Comparison:
    """Two images, compared under one view."""

    #: How both were shown and seen, gamma included.
    view: View
    difference: Difference
    #: What the screen showed of the test image: (H, W, 3) float32 linear light in [0, 1].
    shown: Image

    @property
    def width(self) -> int:
        """Pixels across."""
        return int(self.shown.shape[1])

    @property
    def height(self) -> int:
        """Pixels down."""
        return int(self.shown.shape[0])

    def as_json(self) -> dict[str, Any]:
        """The result as JSON values."""
        return {
            "visible_pixels": self.difference.count,
            "visible_fraction": self.difference.fraction,
            "non_finite_pixels": self.difference.non_finite,
            "width": self.width,
            "height": self.height,
            "view": asdict(self.view),
        }

    def in_words(self) -> str:
        """The result as a sentence."""
        count, total = self.difference.count, self.width * self.height
        noun, verb = "pixel" if total == 1 else "pixels", "differs" if count == 1 else "differ"
        words = f"{count:,} of {total:,} {noun} ({share(count, total)}) {verb} visibly"
        lost = self.difference.non_finite
        if lost:
            words += f"; {lost:,} of them {'is' if lost == 1 else 'are'} NaN or infinite"
        return words

    def map_picture(self) -> NDArray[np.uint8]:
        """The visible pixels marked on the test image in dim grey: (H, W, 3) uint8 sRGB."""
        return difference_picture(self.shown, self.difference.visible)

    def write_map(self, path: Path) -> None:
        """Write `map_picture` as a PNG file."""
        path.write_bytes(encode_png(self.map_picture()))


def compare_files(
    reference: Path, test: Path, view: View | None = None, *, gamma: float | None = None
) -> Comparison:
    """Compare two PNG or two EXR files, as both would be seen on the same screen.

    Parameters
    ----------
    reference, test
        The files, of one kind and size. Which is which changes no count.
    view
        How they are shown and seen, but for its gamma.
    gamma
        Power from the files' values to linear light; None for that of their kind: 2.2 for PNG,
        1 for EXR. Colour profiles and other such notes in the files are not read.

    Raises
    ------
    CannotCompare
        A file cannot be read, or the two are not of one kind and size.
    """
    reference_kind, reference_image = read_image(reference)
    test_kind, test_image = read_image(test)
    if reference_kind != test_kind:
        raise CannotCompare(
            f"{reference} is {reference_kind.name} and {test} is {test_kind.name}, which a screen "
            "shows differently: save both as one or the other"
        )
    view = replace(view or View(), gamma=reference_kind.gamma if gamma is None else gamma)
    metric = VisibleDifferences(view)
    try:
        difference = metric.compare(metric.percept(reference_image), metric.percept(test_image))
    except ValueError as error:
        raise CannotCompare(str(error)) from error
    return Comparison(view=view, difference=difference, shown=displayed(test_image, view))


def read_image(path: Path) -> tuple[FileKind, Image]:
    """Return what kind of file it is, by its first bytes, and its image, (H, W, 3) float32.

    Raises
    ------
    CannotCompare
        It cannot be read, or is no PNG or EXR file that can be judged.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise CannotCompare(f"{path}: {error.strerror or error}") from error
    kind = next((kind for kind in KINDS if content.startswith(kind.signature)), None)
    if kind is None:
        raise CannotCompare(f"{path} is neither a PNG nor an EXR file")
    try:
        # OpenEXR prints its warnings, where scripts expect an answer; an error follows them.
        with contextlib.redirect_stdout(io.StringIO()):
            return kind, kind.decode(content)
    except Exception as error:
        # Of a damaged file the codecs raise what they like.
        words = " ".join(str(error).split())
        raise CannotCompare(f"{path}, as {kind.name}: {words}") from error


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
