"""Looks for tests: view transforms that are known without a renderer."""

import numpy as np

from plateau.farm.images.view_transform import ViewTransform, lattice


def srgb_transform(gain: float = 1.0, power: float = 1.0) -> ViewTransform:
    """That of sRGB's own curve, of the radiance to this power."""
    light = np.clip(lattice(gain) * gain, 0, 1) ** power
    codes = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    axis = np.rint(codes * 65535).astype(np.uint16)
    return ViewTransform(np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1), gain)
