"""The renderers of the farm and their variants: what everyone but a worker has to know of them.

A renderer is a program that renders slices. A variant is one way in which it draws samples: two
variants draw other samples of the same scene, so a job keeps to one. A variant's full name is
``RENDERER:VARIANT``. Mitsuba's variants are stored and shown without ``mitsuba:``, and taken with
it or without. All others are named in full.

What a renderer is to a worker is in `plateau.worker.renderers.contract`, and the format of its
scenes in `plateau.farm.bundle.formats`. ``docs/renderers.md`` says what a new renderer takes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, get_args

MITSUBA: Final = "mitsuba"
ANALYTIC: Final = "analytic"

#: Every variant, as it is stored and shown.
RenderVariant = Literal[
    "scalar_rgb",
    "llvm_ad_rgb",
    "cuda_ad_rgb",
    "analytic:numpy",
    "scalar_spectral",
    "scalar_spectral_polarized",
    "llvm_ad_mono",
    "llvm_ad_mono_polarized",
    "llvm_ad_spectral",
    "llvm_ad_spectral_polarized",
    "cuda_ad_mono",
    "cuda_ad_mono_polarized",
    "cuda_ad_spectral",
    "cuda_ad_spectral_polarized",
]
#: And what a job may ask for: in one list, so that a mistyped name is answered with all of them.
AnyVariant = Literal["auto", RenderVariant]


@dataclass(frozen=True, kw_only=True)
class VariantFacts:
    """What the farm knows of a variant.

    Attributes
    ----------
    renderer : str
        The renderer's name: that of its package in `plateau.worker.renderers`.
    own_name : str
        The variant, as the renderer itself calls it.
    seeds : {"distinct", "scalar"}
        Which seeds give independent samples, see `plateau.farm.model.seeds`: any that are distinct,
        or those of Mitsuba's scalar variants.
    renders_in_parts : bool
        Whether a pass is rendered in parts, and so may have any number of samples.
    on_gpu : bool
        Whether a GPU's driver renders: it needs more than a confined child may have.
    works_everywhere : bool
        Whether it needs nothing of a machine, so that a worker offers it without a trial.
    """

    renderer: str
    own_name: str
    seeds: Literal["distinct", "scalar"] = "distinct"
    renders_in_parts: bool = True
    on_gpu: bool = False
    works_everywhere: bool = False

    @property
    def backend(self) -> str:
        """What compiles or runs it: variants of one backend work where one of them does."""
        return f"{self.renderer}:{self.own_name.partition('_')[0]}"


def _facts(shown: RenderVariant) -> VariantFacts:
    if shown == "analytic:numpy":
        return VariantFacts(renderer=ANALYTIC, own_name="numpy", works_everywhere=True)
    if shown.startswith("scalar"):
        return VariantFacts(
            renderer=MITSUBA,
            own_name=shown,
            seeds="scalar",
            renders_in_parts=False,
            works_everywhere=True,
        )
    return VariantFacts(renderer=MITSUBA, own_name=shown, on_gpu=shown.startswith("cuda"))


VARIANTS: Final[dict[RenderVariant, VariantFacts]] = {
    shown: _facts(shown) for shown in get_args(RenderVariant)
}


def shown_name(variant: str) -> str:
    """Return a variant's name as it is stored and shown; a name that is none stays as it is.

    Examples
    --------
    >>> shown_name("mitsuba:llvm_ad_rgb")
    'llvm_ad_rgb'
    """
    return variant.removeprefix(f"{MITSUBA}:")


def variant_named(name: str) -> VariantFacts:
    """Return what the farm knows of a variant, by the name that it is stored and shown under.

    Raises
    ------
    ValueError
        There is no such variant.
    """
    for known, facts in VARIANTS.items():
        if known == name:
            return facts
    raise ValueError(f"there is no variant {name!r}; there are {', '.join(VARIANTS)}")


def variant_for(asked: str, renderer: str) -> RenderVariant | Literal["auto"]:
    """Return the variant that a job of this renderer's scene has, by the one that was asked for.

    Mitsuba's ``auto`` stays: the first worker decides. Of other renderers it is the first variant.

    Raises
    ------
    ValueError
        It is a variant of another renderer; the message says what to do.
    """
    own: list[RenderVariant] = [
        name for name, known in VARIANTS.items() if known.renderer == renderer
    ]
    if asked == "auto":
        return "auto" if renderer == MITSUBA else own[0]
    for name in own:
        if name == asked:
            return name
    raise ValueError(
        f"the scene is one for the renderer {renderer}, which has no variant {asked}; leave the "
        f"variant out, or name {' or '.join(own)}"
    )
