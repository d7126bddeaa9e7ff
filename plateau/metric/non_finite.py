"""Pixels that are NaN or infinite: their places, and their allowed number."""

from dataclasses import dataclass

import numpy as np

from plateau.metric.display import Image, Mask, as_image, finite_pixels

#: The allowed share of such pixels. No sample repairs them, and no count includes them.
MOST_NON_FINITE = 0.001
#: The number that is allowed in an image of any size. An image with more fails its job.
ALWAYS_ALLOWED = 2


def allowed_non_finite(pixels: int) -> int:
    """Return how many pixels of an image may be NaN or infinite.

    Examples
    --------
    >>> allowed_non_finite(64 * 64), allowed_non_finite(512 * 512), allowed_non_finite(100)
    (4, 262, 2)
    """
    return max(ALWAYS_ALLOWED, int(MOST_NON_FINITE * pixels))


@dataclass(frozen=True, eq=False)
class NonFinite:
    """The pixels of an image that are not finite, in two maps without overlap."""

    #: Pixels with a channel that is NaN, (H, W) bool.
    nan: Mask
    #: Pixels with a channel that is infinite and none that is NaN, (H, W) bool.
    infinite: Mask

    @property
    def count(self) -> int:
        """Their number."""
        return int(np.count_nonzero(self.nan)) + int(np.count_nonzero(self.infinite))

    def in_words(self) -> str:
        """Return a phrase with their number, the number of all pixels, and their kind.

        Examples
        --------
        >>> image = np.zeros((10, 10, 3), np.float32)
        >>> image[0, :2, 1] = np.inf
        >>> non_finite_pixels(image).in_words()
        '2 of 100 pixels (2 %) are infinite'
        >>> image[1, 1, 0] = np.nan
        >>> non_finite_pixels(image).in_words()
        '3 of 100 pixels (3 %) are NaN or infinite'
        """
        kinds = {"NaN": self.nan, "infinite": self.infinite}
        what = " or ".join(name for name, mask in kinds.items() if mask.any())
        count, pixels = self.count, self.nan.size
        verb = "is" if count == 1 else "are"
        return f"{count:,} of {pixels:,} pixels ({100 * count / pixels:.3g} %) {verb} {what}"


def non_finite_pixels(image: Image) -> NonFinite:
    """Return which pixels of an image are NaN or infinite.

    Parameters
    ----------
    image
        (H, W, 3), of any real dtype.

    Raises
    ------
    ValueError
        If the image is not (H, W, 3).
    """
    image = as_image(image)
    nan: Mask = np.asarray(np.isnan(image).any(axis=-1))
    return NonFinite(nan, ~(nan | finite_pixels(image)))
