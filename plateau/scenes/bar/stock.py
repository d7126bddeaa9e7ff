"""What stands where: the bottles on the shelves, and the copies of everything else."""

import random
from dataclasses import dataclass

from plateau.scenes.bar.room import BAYS, COUNTER_TOP, SHELF_X, SHELVES
from plateau.scenes.bar.vessels import BOTTLES
from plateau.scenes.mesh import Vector


@dataclass(frozen=True)
class Copy:
    """A copy of a mesh: where it stands, turned about the vertical, and its scale."""

    mesh: str
    at: Vector
    turn_deg: float = 0.0
    scale: float = 1.0


#: Colours of bottles, by kind: what a surface of the glass lets through.
COLOURS = {
    "clear": (0.98, 0.99, 0.98),
    "amber": (0.95, 0.62, 0.22),
    "brown": (0.80, 0.40, 0.14),
    "green": (0.45, 0.80, 0.42),
    "ruby": (0.88, 0.16, 0.12),
    "blue": (0.35, 0.55, 0.92),
}
_MAY_BE = {
    "spirit": ("clear", "amber", "amber", "brown"),
    "wine": ("green", "green", "ruby"),
    "decanter": ("amber", "brown", "clear"),
    "flute": ("clear", "green", "ruby", "blue"),
    "jug": ("amber", "green", "blue"),
}
LABELS = ("cream", "black")

LAMPS: tuple[Vector, ...] = tuple((-0.27, 1.98, z) for z in (0.9, -0.3, -1.5))
STOOLS: tuple[tuple[float, float], ...] = tuple((0.42, z) for z in (0.75, 0.0, -0.75, -1.5))


def stock(seed: int) -> dict[str, list[Copy]]:
    """Return the bottles' parts by their material."""
    chance = random.Random(seed)
    parts: dict[str, list[Copy]] = {}
    kinds = tuple(BOTTLES)
    for bay in range(3):
        for shelf, height in enumerate(SHELVES):
            if bay == 1 and shelf > 0:
                continue
            z = BAYS[bay] + 0.13
            while z < BAYS[bay + 1] - 0.11:
                kind = kinds[int(chance.random() * len(kinds))]
                colour = _MAY_BE[kind][int(chance.random() * len(_MAY_BE[kind]))]
                label = LABELS[int(chance.random() * len(LABELS))]
                at = (SHELF_X + 0.02 * (chance.random() - 0.5), height + 0.0005, z)
                turn = 90 + 40 * (chance.random() - 0.5)
                scale = 0.92 + 0.13 * chance.random()
                parts.setdefault(colour, []).append(Copy(f"{kind}_glass", at, turn, scale))
                parts.setdefault(label, []).append(Copy(f"{kind}_label", at, turn, scale))
                parts.setdefault("cap", []).append(Copy(f"{kind}_cap", at, turn, scale))
                z += 0.105 + 0.05 * chance.random()
    return parts


def laid() -> dict[str, list[Copy]]:
    """Return what is on the counter by its material."""
    y = COUNTER_TOP + 0.0005
    parts: dict[str, list[Copy]] = {"clear": []}
    for glass, drink, at in (
        ("coupe", "cocktail", (-0.16, y, 1.58)),
        ("tumbler", "whisky", (-0.34, y, 1.36)),
    ):
        parts["clear"].append(Copy(f"{glass}_glass", at))
        parts[drink] = [Copy(f"{glass}_drink", at)]
        parts[f"{drink}_level"] = [Copy(f"{glass}_level", at)]
    parts["clear"] += [
        Copy("goblet_empty", (-0.50 + 0.02 * (k % 2), y, 0.35 - 0.12 * k)) for k in range(6)
    ]
    parts["steel"] = [Copy("shaker", (-0.50, y, 0.98))]
    return parts
