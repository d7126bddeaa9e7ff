"""Compiled `plateau.metric.denoise`: the same bits with fewer passes over memory."""

import numpy as np

from plateau.metric.compiled.jit import entry_point, kernel
from plateau.metric.denoise import BANDS, CAUTION, LEAST_ENERGY, planar
from plateau.metric.display import Image, Plane
from plateau.metric.pyramid import KERNEL
from plateau.metric.rows import by_rows

_CENTRE, _NEAR, _FAR = (np.float32(tap) for tap in KERNEL)
_CAUTION, _LEAST_ENERGY = np.float32(CAUTION), np.float32(LEAST_ENERGY)
_NOTHING, _ALL = np.float32(0), np.float32(1)


def denoised(image: Image, noise: Image) -> Image:
    """Return the bits of `plateau.metric.denoise.denoised`."""
    rest, noise_rest = planar(image), planar(noise)
    kept = np.zeros_like(rest)
    energy, noise_energy = np.empty_like(rest[0]), np.empty_like(rest[0])
    for band in range(BANDS):
        gap = 2**band
        coarse, noise_coarse = smoothed(rest, gap), smoothed(noise_rest, gap)
        by_rows(_energies, energy.shape, rest, coarse, energy)
        by_rows(_energies, energy.shape, noise_rest, noise_coarse, noise_energy)
        local = smoothed(energy, gap)
        noise_local = smoothed(smoothed(noise_energy, 2 * gap), gap)
        by_rows(_keep, kept.shape, rest, coarse, local, noise_local, kept)
        rest, noise_rest = coarse, noise_coarse
    clean: Image = np.moveaxis(kept + rest, 0, -1)
    return clean


def smoothed(planes: Plane, gap: int) -> Plane:
    """Return the bits of `plateau.metric.denoise.smoothed`."""
    stack = np.ascontiguousarray(planes).reshape(-1, *planes.shape[-2:])
    out = np.empty_like(stack)
    by_rows(_smooth, stack.shape, stack, gap, out)
    return out.reshape(planes.shape)


@entry_point
def _energies(first: int, last: int, rest: Plane, coarse: Plane, out: Plane) -> None:
    for y in range(first, last):
        _add_squares(
            rest[0, y], coarse[0, y], rest[1, y], coarse[1, y], rest[2, y], coarse[2, y], out[y]
        )


@kernel
def _add_squares(
    red: Plane,
    coarse_red: Plane,
    green: Plane,
    coarse_green: Plane,
    blue: Plane,
    coarse_blue: Plane,
    out: Plane,
) -> None:
    for x in range(out.size):
        detail = red[x] - coarse_red[x]
        value = detail * detail
        detail = green[x] - coarse_green[x]
        value += detail * detail
        detail = blue[x] - coarse_blue[x]
        value += detail * detail
        out[x] = value


@entry_point
def _keep(
    first: int,
    last: int,
    rest: Plane,
    coarse: Plane,
    energy: Plane,
    noise_energy: Plane,
    kept: Plane,
) -> None:
    gain = np.empty_like(energy[0])
    for y in range(first, last):
        _find_gain(energy[y], noise_energy[y], gain)
        for channel in range(3):
            _add_kept(rest[channel, y], coarse[channel, y], gain, kept[channel, y])


@kernel
def _find_gain(energy: Plane, noise_energy: Plane, out: Plane) -> None:
    for x in range(out.size):
        gain = _ALL - _CAUTION * noise_energy[x] / max(energy[x], _LEAST_ENERGY)
        out[x] = max(gain, _NOTHING)


@kernel
def _add_kept(rest: Plane, coarse: Plane, gain: Plane, kept: Plane) -> None:
    for x in range(kept.size):
        kept[x] += gain[x] * (rest[x] - coarse[x])


@entry_point
def _smooth(first: int, last: int, stack: Plane, gap: int, out: Plane) -> None:
    row = np.empty(stack.shape[2], np.float32)
    for number in range(stack.shape[0]):
        plane, height = stack[number], stack.shape[1]
        border = height - 1
        for y in range(first, last):
            _add_up(
                plane[y],
                plane[max(y - gap, 0)],
                plane[min(y + gap, border)],
                plane[max(y - 2 * gap, 0)],
                plane[min(y + 2 * gap, border)],
                row,
            )
            _along(row, gap, out[number, y])


@kernel
def _add_up(
    centre: Plane, above: Plane, below: Plane, far_above: Plane, far_below: Plane, out: Plane
) -> None:
    for x in range(out.size):
        value = centre[x] * _CENTRE
        value += (above[x] + below[x]) * _NEAR
        value += (far_above[x] + far_below[x]) * _FAR
        out[x] = value


@kernel
def _along(row: Plane, gap: int, out: Plane) -> None:
    last, reach = row.size - 1, 2 * gap
    for x in range(min(reach, row.size)):
        out[x] = _at_border(row, x, gap, last)
    # The loop is vectorised only over slices that start at 0.
    inside = max(row.size - 2 * reach, 0)
    if inside > 0:
        _add_up(
            row[reach : reach + inside],
            row[reach - gap : reach - gap + inside],
            row[reach + gap : reach + gap + inside],
            row[:inside],
            row[2 * reach :],
            out[reach : reach + inside],
        )
    for x in range(max(row.size - reach, min(reach, row.size)), row.size):
        out[x] = _at_border(row, x, gap, last)


@kernel
def _at_border(row: Plane, x: int, gap: int, last: int) -> np.float32:
    value: np.float32 = row[x] * _CENTRE
    value += (row[max(x - gap, 0)] + row[min(x + gap, last)]) * _NEAR
    value += (row[max(x - 2 * gap, 0)] + row[min(x + 2 * gap, last)]) * _FAR
    return value
