"""The eight scenes of the paper: four families, each under a bright and under a dim light."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module


@dataclass(frozen=True)
class Case:
    """One scene under one light."""

    name: str  #: as in the paper: ``BAR 1``
    family: str  #: a folder of `scenes`
    intensity: float  #: the scene's parameter of that name
    #: Seeds of the series and of the reference; no two renders of a family share samples.
    seeds: tuple[int, int]

    @property
    def slug(self) -> str:
        """The name in file names."""
        return self.name.lower().replace(" ", "-")


def _family(name: str) -> list[Case]:
    build = import_module(f"plateau.scenes.{name}.build")
    return [
        Case(f"{name.upper()} {number}", name, intensity, (2 * number - 2, 2 * number - 1))
        for number, intensity in ((1, build.BRIGHT), (2, build.DIM))
    ]


def cases(families: tuple[str, ...]) -> list[Case]:
    """Return the scenes of these families."""
    return [case for family in families for case in _family(family)]
