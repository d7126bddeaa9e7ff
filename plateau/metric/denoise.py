"""A denoiser for an image of whose noise a sample is known.

Undecimated wavelets (*à trous*) split the image and the noise into bands. In each band the energy
of the noise around each pixel is known, and the filter keeps the part of the band whose energy
exceeds it: a Wiener filter without guesses. Texture above the noise stays; flat areas become flat.
"""

from collections.abc import Sequence

import numpy as np

from plateau.metric.display import Image, Plane
from plateau.metric.pyramid import KERNEL

#: Bands; the coarsest is about this power of two pixels wide. Coarser noise masks nothing.
BANDS = 3
#: The filter removes this many times the noise's energy, because one sample is a rough estimate.
CAUTION = 2.0
#: The least energy, in squared radiance; it prevents 0/0.
LEAST_ENERGY = 1e-30


def smoothed(planes: Plane, gap: int, kernel: Sequence[float] = KERNEL) -> Plane:
    """Return planes, (…, H, W) float32, blurred by a kernel, its taps `gap` apart.

    The kernel is the pyramid's, or any that is given by its centre and the taps beside it. Beyond a
    border it reads the pixel at the border.
    """
    for axis in (-2, -1):
        planes = _smoothed_along(planes, axis, gap, kernel)
    return planes


def denoised(image: Image, noise: Image) -> Image:
    """Return the image without its noise, (H, W, 3) float32.

    Parameters
    ----------
    image
        (H, W, 3) float32, finite.
    noise
        A sample of noise, independent of the image's own, with mean 0 and the same variance at each
        pixel: (H, W, 3) float32, finite.

    References
    ----------
    M. Holschneider, R. Kronland-Martinet, J. Morlet and P. Tchamitchian, A real-time algorithm for
    signal analysis with the help of the wavelet transform, in Wavelets, Springer 1989.
    doi:10.1007/978-3-642-75988-8_28
    M. K. Mıhçak, I. Kozintsev, K. Ramchandran and P. Moulin, Low-complexity image denoising based
    on statistical modeling of wavelet coefficients, IEEE Signal Processing Letters 6(12), 1999
    (the gain from local energies). doi:10.1109/97.803428

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> light = np.full((64, 64, 3), 0.5, np.float32)
    >>> one, other = rng.normal(0, 0.1, (2, 64, 64, 3)).astype(np.float32)
    >>> left = denoised(light + one, other) - light
    >>> bool(left.std() < 0.02)
    True
    """
    rest, noise_rest = planar(image), planar(noise)
    kept = np.zeros_like(rest)
    for band in range(BANDS):
        gap = 2**band
        coarse, noise_coarse = smoothed(rest, gap), smoothed(noise_rest, gap)
        detail = rest - coarse
        # One gain for all channels: a path's noise is mostly brightness.
        energy = smoothed(np.square(detail).sum(axis=0), gap)
        noise_energy = np.square(noise_rest - noise_coarse).sum(axis=0)
        noise_energy = smoothed(smoothed(noise_energy, 2 * gap), gap)
        gain = 1 - np.float32(CAUTION) * noise_energy / np.maximum(energy, LEAST_ENERGY)
        kept += np.maximum(gain, 0) * detail
        rest, noise_rest = coarse, noise_coarse
    clean: Image = np.moveaxis(kept + rest, 0, -1)
    return clean


def planar(image: Image) -> Plane:
    """Return the image as (3, H, W) float32, because every step reads one channel at a time."""
    return np.ascontiguousarray(np.moveaxis(image, -1, 0), np.float32)


def _smoothed_along(planes: Plane, axis: int, gap: int, kernel: Sequence[float]) -> Plane:
    size, reach = planes.shape[axis], gap * (len(kernel) - 1)
    bordered = np.take(planes, np.arange(-reach, size + reach).clip(0, size - 1), axis=axis)

    def shifted(by: int) -> Plane:
        window = [slice(None)] * planes.ndim
        window[axis] = slice(reach + by, reach + by + size)
        return bordered[tuple(window)]

    centre, *sides = kernel
    blurred: Plane = shifted(0) * np.float32(centre)
    for number, weight in enumerate(sides, start=1):
        blurred += (shifted(-number * gap) + shifted(number * gap)) * np.float32(weight)
    return blurred
