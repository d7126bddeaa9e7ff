"""The eight scenes of the paper: four families, each under a bright and under a dim light."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module


@dataclass(frozen=True)
class Case:
    """One scene under one light."""

    #: As the paper calls it: ``BAR 1``.
    name: str
    #: A folder of `scenes`.
    family: str
    #: What the scene's `intensity` is set to.
    intensity: float
    #: Seeds of the series and of the reference: no two renders of a family share their samples.
    seeds: tuple[int, int]

    @property
    def slug(self) -> str:
        """The name, as files are called."""
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
