"""Eight copies of a luminance plane with increasing blur, all at full resolution."""

from itertools import pairwise

import numpy as np

from plateau.metric.display import Plane

#: Levels, with the sharp plane.
LEVELS = 8
#: The separable kernel: the centre, its two neighbours, the two beyond.
KERNEL = (0.4, 0.25, 0.05)
#: Pixels that the kernel reads on either side.
REACH = 2


def border_index(index: int, size: int) -> int:
    """Return which pixel of a line of `size` pixels the kernel reads at `index`.

    Inside the line it is the index itself. Before the line, index n reads -n (the edge is not
    repeated); behind it, n reads 2·size - n - 1 (the edge is repeated). The rule is repeated until
    the result is inside the line, which matters for a single pixel only.

    Notes
    -----
    The two ends differ as in Yee's program, whose counts are the reference.

    Examples
    --------
    >>> [border_index(n, 5) for n in (-2, -1, 0, 4, 5, 6)]
    [2, 1, 0, 4, 4, 3]
    >>> [border_index(n, 1) for n in (-2, -1, 0, 1, 2)]
    [0, 0, 0, 0, 0]
    """
    if size < 1:
        raise ValueError(f"a line must have at least one pixel, not {size}")
    while not 0 <= index < size:
        index = -index if index < 0 else 2 * size - index - 1
    return index


def blurred_levels(plane: Plane) -> Plane:
    """Return the plane and its seven successive blurs as (8, H, W), float32.

    Level 0 is the plane; each further one is the 5-tap separable blur (.05 .25 .4 .25 .05) of the
    one before, with borders by `border_index`.

    References
    ----------
    P. J. Burt and E. H. Adelson, The Laplacian pyramid as a compact image code, IEEE Trans.
    Commun. 31(4), 1983 (the kernel, with a = 0.4). doi:10.1109/TCOM.1983.1095851
    H. Yee, A perceptual metric for production testing, journal of graphics tools 9(4), 2004.
    doi:10.1080/10867651.2004.10504900

    Examples
    --------
    >>> levels = blurred_levels(np.ones((4, 6), np.float32))
    >>> levels.shape, bool(np.allclose(levels, 1))
    ((8, 4, 6), True)
    """
    height, width = plane.shape
    levels: Plane = np.empty((LEVELS, height, width), np.float32)
    levels[0] = plane

    # One bordered copy serves every level; its margins repeat pixels of its inside.
    bordered: Plane = np.empty((height + 2 * REACH, width + 2 * REACH), np.float32)
    inside = bordered[REACH:-REACH, REACH:-REACH]
    rows, mirrored_rows = _margins(height)
    columns, mirrored_columns = _margins(width)
    across = np.empty((height + 2 * REACH, width), np.float32)
    work = np.empty_like(across)

    for finer, coarser in pairwise(levels):
        inside[:] = finer
        bordered[:, columns] = bordered[:, mirrored_columns]
        bordered[rows] = bordered[mirrored_rows]
        _five_taps([bordered[:, k : k + width] for k in range(5)], across, work)
        _five_taps([across[k : k + height] for k in range(5)], coarser, work[:height])
    return levels


def _margins(size: int) -> tuple[list[int], list[int]]:
    """Return the indices of a bordered line's margins, and those of the repeated pixels."""
    beyond = (-2, -1, size, size + 1)
    return [n + REACH for n in beyond], [border_index(n, size) + REACH for n in beyond]


def _five_taps(taps: list[Plane], out: Plane, work: Plane) -> None:
    """Write the kernel's weighted sum of five shifted planes to `out`, using `work` as space."""
    centre, near, far = KERNEL
    np.add(taps[0], taps[4], out=out)
    np.multiply(out, far, out=out)
    np.add(taps[1], taps[3], out=work)
    np.multiply(work, near, out=work)
    np.add(out, work, out=out)
    np.multiply(taps[2], centre, out=work)
    np.add(out, work, out=out)
