"""How a scene wants its light to be shown: its view transform, baked into a table.

A renderer that has such a transform (AgX or Filmic, with exposure and contrast) bakes it with its
own library. So whoever judges and shows the image needs no such library.
"""

import base64
import zlib
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

#: Values of R, G and B each in a table.
SIZE: Final = 33
#: A table is even in log2(1023 x + 1) of the radiance x times the gain: from 0 to 64, and a value
#: of it is at 1.
_STOPS: Final = 16
_SLOPE: Final = 2.0**10 - 1
_MOST_CODE: Final = 65535
#: Pixels that are looked up at once.
_BLOCK: Final = 2**18


@dataclass(frozen=True, eq=False)
class ViewTransform:
    """A view transform.

    Parameters
    ----------
    table : ndarray, shape (33, 33, 33, 3), uint16
        The sRGB codes of the display at each R, G and B of `lattice`, of which 65535 is white.
    gain : float
        By what radiance is multiplied to get the table's own scale.
    """

    table: NDArray[np.uint16]
    gain: float = 1.0

    def seen(self, image: NDArray[np.float32], exposure_ev: float = 0.0) -> NDArray[np.float32]:
        """Return the light of the display: linear, from 0 to 1 once the exposure has acted.

        Parameters
        ----------
        image : ndarray, shape (height, width, 3), float32
            Linear radiance in Rec. 709. Pixels with NaN or infinities stay as they are.
        exposure_ev : float
            The exposure under which the result will be seen; it acts before the transform.
        """
        factor = np.float32(2.0**exposure_ev)
        flat = image.reshape(-1, 3)
        shown = flat.copy()
        finite = np.flatnonzero(np.isfinite(flat).all(axis=-1))
        for start in range(0, len(finite), _BLOCK):
            here = finite[start : start + _BLOCK]
            codes = self._codes(flat[here] * (factor * np.float32(self.gain)))
            shown[here] = _decoded(codes) / factor
        seen: NDArray[np.float32] = shown.reshape(image.shape)
        return seen

    def _codes(self, scaled: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return sRGB values in [0, 1] by trilinear interpolation."""
        place = np.log2(np.maximum(scaled, 0) * np.float32(_SLOPE) + 1) * ((SIZE - 1) / _STOPS)
        place = np.minimum(place, np.float32(SIZE - 1))
        cell = np.minimum(place.astype(np.int32), SIZE - 2)
        part = place - cell
        strides = np.array([SIZE * SIZE, SIZE, 1], np.int32)
        first = cell @ strides
        flat = self.table.reshape(-1, 3)
        codes = np.zeros(scaled.shape, np.float32)
        for corner in np.ndindex(2, 2, 2):
            weight = np.where(corner, part, 1 - part).prod(axis=-1, dtype=np.float32)
            codes += weight[:, None] * flat[first + int(np.dot(corner, strides))]
        codes /= np.float32(_MOST_CODE)
        return codes

    def as_text(self) -> str:
        """Return it as ASCII text."""
        packed = zlib.compress(np.ascontiguousarray(self.table, "<u2").tobytes())
        return f"{self.gain!r} {base64.b64encode(packed).decode()}"

    @classmethod
    def from_text(cls, text: str) -> "ViewTransform":
        """Return the one that a text is; raise `ValueError` where it is none."""
        gain, _, packed = text.partition(" ")
        most = SIZE**3 * 3 * 2
        try:
            content = zlib.decompressobj().decompress(base64.b64decode(packed), most + 1)
            scale = float(gain)
        except (ValueError, zlib.error) as error:
            raise ValueError(f"no table of a view transform: {error}") from error
        if len(content) != most or not 0 < scale < np.inf:
            raise ValueError("no table of a view transform: it has another size, or no gain")
        return cls(np.frombuffer(content, "<u2").reshape(SIZE, SIZE, SIZE, 3), scale)


def lattice(gain: float) -> NDArray[np.float64]:
    """Return the radiances of a table's values, from 0 up, which R, G and B have alike."""
    values: NDArray[np.float64] = (2 ** np.linspace(0, _STOPS, SIZE) - 1) / _SLOPE / gain
    return values


def _decoded(codes: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the linear light of sRGB values (IEC 61966-2-1)."""
    light: NDArray[np.float32] = np.where(
        codes <= 0.04045, codes / 12.92, ((codes + 0.055) / 1.055) ** 2.4
    ).astype(np.float32)
    return light
