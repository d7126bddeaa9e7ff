"""What stands on the counter and the shelves: bottles with labels and caps, and filled glasses.

Lengths are in metres. A point of a profile that is given twice is an edge.
"""

from dataclasses import dataclass

from plateau.scenes.bar.turning import Point, rounded, turned
from plateau.scenes.mesh import Mesh

_BOTTLE, _GLASS = 24, 48


@dataclass(frozen=True)
class Bottle:
    """A bottle that is full to its neck: a solid of coloured glass with a label and a cap."""

    profile: tuple[Point, ...]
    #: radius, and the heights between which the label sticks
    label: tuple[float, float, float]
    #: radius, and the heights between which the cap sits
    cap: tuple[float, float, float]

    def meshes(self) -> dict[str, Mesh]:
        """Return its parts by name."""
        radius, low, high = self.label
        cap, foot, top = self.cap
        return {
            "glass": turned(rounded(self.profile), _BOTTLE),
            "label": turned([(radius, low), (radius, high)], _BOTTLE, share=0.5),
            "cap": turned([(cap, foot), (cap, top), (0, top)], _BOTTLE // 2),
        }


BOTTLES = {
    "spirit": Bottle(
        (
            (0, 0),
            (0.037, 0),
            (0.037, 0),
            (0.039, 0.006),
            (0.039, 0.175),
            (0.036, 0.205),
            (0.016, 0.222),
            (0.0135, 0.25),
            (0.0135, 0.29),
            (0.0135, 0.29),
            (0, 0.29),
        ),
        (0.0394, 0.045, 0.135),
        (0.0165, 0.270, 0.305),
    ),
    "wine": Bottle(
        (
            (0, 0),
            (0.035, 0),
            (0.035, 0),
            (0.037, 0.006),
            (0.037, 0.19),
            (0.036, 0.215),
            (0.015, 0.25),
            (0.014, 0.275),
            (0.014, 0.318),
            (0.014, 0.318),
            (0, 0.318),
        ),
        (0.0374, 0.060, 0.160),
        (0.0146, 0.262, 0.320),
    ),
    "decanter": Bottle(
        (
            (0, 0),
            (0.044, 0),
            (0.044, 0),
            (0.048, 0.01),
            (0.052, 0.09),
            (0.05, 0.13),
            (0.02, 0.155),
            (0.0145, 0.17),
            (0.0145, 0.205),
            (0.0145, 0.205),
            (0, 0.205),
        ),
        (0.0525, 0.062, 0.100),
        (0.0190, 0.195, 0.235),
    ),
    "flute": Bottle(
        (
            (0, 0),
            (0.027, 0),
            (0.027, 0),
            (0.03, 0.006),
            (0.033, 0.12),
            (0.03, 0.2),
            (0.014, 0.27),
            (0.012, 0.3),
            (0.012, 0.34),
            (0.012, 0.34),
            (0, 0.34),
        ),
        (0.0335, 0.060, 0.135),
        (0.0150, 0.325, 0.362),
    ),
    "jug": Bottle(
        (
            (0, 0),
            (0.04, 0),
            (0.04, 0),
            (0.046, 0.008),
            (0.042, 0.06),
            (0.03, 0.11),
            (0.036, 0.155),
            (0.015, 0.19),
            (0.013, 0.21),
            (0.013, 0.255),
            (0.013, 0.255),
            (0, 0.255),
        ),
        (0.0165, 0.205, 0.206),
        (0.0175, 0.240, 0.268),
    ),
}


@dataclass(frozen=True)
class Glass:
    """A drinking glass with a real wall, filled up to a point of its inside."""

    #: from the middle of the underside to the rim
    outside: tuple[Point, ...]
    #: from the rim to the surface of what is in it
    dry: tuple[Point, ...]
    #: from that surface to the middle of the bottom
    wet: tuple[Point, ...]

    def meshes(self) -> dict[str, Mesh]:
        """Return its interfaces by name: glass to air, glass to drink, and drink to air."""
        drink = [*rounded((self.dry[-1], self.dry[-1], *self.wet))]
        level = self.dry[-1]
        return {
            "glass": turned([*rounded(self.outside), *rounded(self.dry)], _GLASS),
            "drink": turned(drink, _GLASS),
            "level": turned([level, (0, level[1])], _GLASS),
        }


GLASSES = {
    "coupe": Glass(
        (
            (0, 0),
            (0.033, 0),
            (0.033, 0),
            (0.033, 0.0015),
            (0.018, 0.004),
            (0.0045, 0.01),
            (0.0038, 0.03),
            (0.0038, 0.075),
            (0.006, 0.088),
            (0.03, 0.1),
            (0.047, 0.118),
            (0.05, 0.15),
            (0.05, 0.15),
            (0.0488, 0.151),
        ),
        ((0.0488, 0.151), (0.0485, 0.151), (0.0472, 0.134)),
        ((0.0455, 0.121), (0.029, 0.103), (0.008, 0.0935), (0, 0.0925)),
    ),
    "tumbler": Glass(
        (
            (0, 0),
            (0.035, 0),
            (0.035, 0),
            (0.038, 0.004),
            (0.0415, 0.09),
            (0.0415, 0.09),
            (0.0405, 0.091),
        ),
        ((0.0405, 0.091), (0.0395, 0.091), (0.0380, 0.042)),
        ((0.0365, 0.016), (0.0330, 0.0125), (0, 0.0120)),
    ),
    "goblet": Glass(
        (
            (0, 0),
            (0.036, 0),
            (0.036, 0),
            (0.036, 0.0015),
            (0.018, 0.004),
            (0.005, 0.012),
            (0.0042, 0.04),
            (0.0042, 0.09),
            (0.008, 0.104),
            (0.036, 0.12),
            (0.043, 0.155),
            (0.0345, 0.22),
            (0.0345, 0.22),
            (0.0337, 0.2207),
        ),
        ((0.0337, 0.2207), (0.0333, 0.220), (0.0405, 0.168), (0.0415, 0.158)),
        ((0.0410, 0.150), (0.034, 0.123), (0.010, 0.1095), (0, 0.1090)),
    ),
}


def empty(glass: Glass) -> Mesh:
    """Return a glass with nothing in it: one closed surface."""
    return turned([*rounded(glass.outside), *rounded((*glass.dry, *glass.wet))], _BOTTLE)


def shaker() -> tuple[Mesh, Mesh]:
    """Return a cocktail shaker of steel, and the brass band about its shoulder."""
    body = ((0, 0), (0.034, 0), (0.034, 0), (0.036, 0.006), (0.044, 0.145), (0.044, 0.155))
    lid = ((0.036, 0.180), (0.022, 0.195), (0.022, 0.195), (0.020, 0.200), (0.019, 0.225))
    knob = ((0.017, 0.236), (0.008, 0.240), (0, 0.240))
    band = ((0.0445, 0.150), (0.0455, 0.152), (0.0455, 0.156), (0.0445, 0.158))
    return turned(rounded((*body, *lid, *knob)), _GLASS), turned(band, _GLASS)
