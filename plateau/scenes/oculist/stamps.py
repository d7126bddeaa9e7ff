"""Oculists' stamps: slabs of stone with letters engraved, or raised, as real relief."""

from collections.abc import Sequence

import numpy as np

from plateau.scenes.build import noise
from plateau.scenes.mesh import Mesh, Vector, joined
from plateau.scenes.oculist.lettering import Field, cut
from plateau.scenes.oculist.surfaces import plane, relief

#: Side of the repeat of the stone's texture, in units of the scene.
_TILE = 0.42


def stamp(
    size: Vector, top: Sequence[str], edge: Sequence[str], cells: float, depth: float, seed: int
) -> Mesh:
    """Return a stamp that stands on the origin, with letters on its top and on its front.

    Parameters
    ----------
    size : (width, height, depth)
        Of the stone.
    top, edge : sequence of str
        What it says, line by line.
    cells : float
        Rows and columns of the relief in one unit of length.
    depth : float
        Of the engraving; letters with a negative depth stand out.
    seed : int
        Of the stone's wear.
    """
    width, height, length = size
    left, front = -width / 2, length / 2

    def face(tall: float, lines: Sequence[str]) -> Field:
        return _worn((round(tall * cells) + 1, round(width * cells) + 1), lines, seed)

    sideways, upwards = (width, 0.0, 0.0), (0.0, height, 0.0)
    return joined(
        relief(
            face(length, top),
            (left, height, front),
            sideways,
            (0.0, 0.0, -length),
            (0.0, depth, 0.0),
            _TILE,
        ),
        relief(face(height, edge), (left, 0.0, front), sideways, upwards, (0.0, 0.0, depth), _TILE),
        plane((left, 0.0, -front), (0.0, 0.0, length), upwards, (1, 0.4)),
        plane((-left, 0.0, front), (0.0, 0.0, -length), upwards, (1, 0.4)),
        plane((-left, 0.0, -front), (-width, 0.0, 0.0), upwards, (1, 0.4)),
    )


def _worn(shape: tuple[int, int], lines: Sequence[str], seed: int) -> Field:
    """Return a face's height in depths: cut, uneven, chipped, and level at its edges."""
    rows, columns = shape
    letters = np.clip(1.6 * cut(shape, lines, stroke=1.25, margin=0.08), 0, 1)
    wear = noise(shape, (rows // 3, columns // 3), seed)
    chips = np.clip((wear - 0.86) / 0.14, 0, 1)
    height = 0.18 * (wear - 0.5) - letters - 0.8 * chips
    height[[0, -1], :] = 0
    height[:, [0, -1]] = 0
    return height
