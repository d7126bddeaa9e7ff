"""Which channels the film of a Mitsuba scene has, and where the integrator gives them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

from plateau.farm.model.aovs import AOVS, AovName

#: What Mitsuba's ``aov`` integrator calls the AOVs that a job may ask for.
MITSUBA_AOVS: Final[Mapping[AovName, str]] = {
    "albedo": "albedo",
    "normal": "sh_normal",
    "depth": "depth",
    "position": "position",
    "uv": "uv",
    "shape_id": "shape_index",
    "primitive_id": "prim_index",
}

#: The channels that a nested integrator has in an ``aov`` integrator's list.
_IMAGE: Final = (".R", ".G", ".B", ".A")
#: How Mitsuba ends the name of a channel of ids.
_OF_IDS: Final = ".I"


@dataclass(frozen=True)
class FilmChannels:
    """The channels of a film.

    Attributes
    ----------
    names : tuple of str
        In the order of a film's values: R, G, B, W, then A with alpha, then AOVs.
    ids : tuple of str
        Those that have the value of a pixel's first sample, and no sum.
    aovs : tuple of int
        Where each AOV stands in what the integrator returns beside radiance.
    """

    names: tuple[str, ...]
    ids: tuple[str, ...]
    aovs: tuple[int, ...]

    @property
    def has_alpha(self) -> bool:
        """Whether the film has A."""
        return "A" in self.names

    @cached_property
    def summed(self) -> tuple[int, ...]:
        """The places of the channels that are sums."""
        return tuple(at for at, name in enumerate(self.names) if name not in self.ids)

    @cached_property
    def of_ids(self) -> tuple[int, ...]:
        """The places of the ids."""
        return tuple(at for at, name in enumerate(self.names) if name in self.ids)


def film_channels(
    *, has_alpha: bool, integrator_names: Sequence[str], asked: Sequence[AovName]
) -> FilmChannels:
    """Return the channels of a film.

    Parameters
    ----------
    has_alpha : bool
        Whether the scene's film has alpha.
    integrator_names : sequence of str
        The names of what the integrator returns beside radiance (Mitsuba's ``aov_names``); what the
        job asks for stands last.
    asked : sequence of str
        The AOVs that the job asks for.

    Examples
    --------
    >>> names = ["image.R", "image.G", "image.B", "image.A", "depth.T"]
    >>> film_channels(has_alpha=False, integrator_names=names, asked=["depth"])
    FilmChannels(names=('R', 'G', 'B', 'W', 'Z'), ids=(), aovs=(4,))
    """
    ours = [channel for name in asked for channel in AOVS[name].channels]
    theirs = dict(_of_scene(integrator_names[: len(integrator_names) - len(ours)]))
    first = len(integrator_names) - len(ours)
    places = {
        **{name: at for name, at in theirs.items() if name not in ours},
        **{name: first + at for at, name in enumerate(ours)},
    }
    our_ids = {channel for name in asked if AOVS[name].is_id for channel in AOVS[name].channels}
    ids = [
        name for name in places if name in our_ids or (name not in ours and name.endswith(_OF_IDS))
    ]
    colour = ("R", "G", "B", "W", *("A" * has_alpha))
    return FilmChannels((*colour, *places), tuple(ids), tuple(places.values()))


def _of_scene(names: Sequence[str]) -> list[tuple[str, int]]:
    """Return the scene's own AOVs and their places, without the image of the first integrator.

    An ``aov`` integrator repeats the image of each integrator inside it. The first of them is the
    film's colour itself.
    """
    numbered = [(name, at) for at, name in enumerate(names)]
    while len(numbered) >= len(_IMAGE):
        inner = numbered[0][0].removesuffix(_IMAGE[0])
        if [name for name, _ in numbered[: len(_IMAGE)]] != [inner + end for end in _IMAGE]:
            break
        numbered = [(name.removeprefix(f"{inner}."), at) for name, at in numbered[len(_IMAGE) :]]
    return numbered
