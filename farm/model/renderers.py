"""The renderers of the farm and their variants, as the whole farm knows them.

A renderer is a program that renders slices. A variant is one way in which it draws samples: two
variants draw different samples of a scene, so a job keeps to one. A variant's full name is
``RENDERER:VARIANT``. Mitsuba's variants are stored and shown without ``mitsuba:``, and accepted
with it or without. All others are named in full.

`plateau.worker.renderers.contract` is a renderer's interface to a worker, and
`plateau.farm.bundle.formats` has the format of its scenes. ``docs/renderers.md`` says what a new
renderer needs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, get_args

MITSUBA: Final = "mitsuba"
ANALYTIC: Final = "analytic"
CYCLES: Final = "cycles"

#: Every variant by its stored and shown name.
RenderVariant = Literal[
    "scalar_rgb",
    "llvm_ad_rgb",
    "cuda_ad_rgb",
    "analytic:numpy",
    "cycles:cpu",
    "cycles:optix",
    "cycles:cuda",
    "cycles:hip",
    "cycles:oneapi",
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
#: The variants that a job may ask for; one list, so that the error for another name has them all.
AnyVariant = Literal["auto", RenderVariant]


@dataclass(frozen=True, kw_only=True)
class VariantFacts:
    """The farm's facts of a variant."""

    renderer: str  #: its package in `plateau.worker.renderers`
    own_name: str  #: the renderer's own name of the variant
    #: seeds of independent samples (`plateau.farm.model.seeds`): any distinct ones, those of
    #: Mitsuba's scalar variants, or places in sequences of samples
    seeds: Literal["distinct", "scalar", "sequences"] = "distinct"
    renders_in_parts: bool = True  #: pass by parts, so that a pass may have any number of samples
    renders_zones: bool = True  #: parts of a film, as jobs that are allocated by zones need them
    on_gpu: bool = False  #: whether it renders on a GPU
    is_confined: bool = True  #: whether its render child is; not where nobody has tried it
    works_everywhere: bool = False  #: wherever its renderer can be loaded: it needs no library
    package: str = ""  #: the Python package that has its renderer; "" for a part of Plateau

    @property
    def backend(self) -> str:
        """The variant's compiler or runtime: where one variant of a backend works, all do."""
        return f"{self.renderer}:{self.own_name.partition('_')[0]}"


def _facts(shown: RenderVariant) -> VariantFacts:
    if shown == "analytic:numpy":
        return VariantFacts(renderer=ANALYTIC, own_name="numpy", works_everywhere=True)
    if shown.startswith(f"{CYCLES}:"):
        device = shown.removeprefix(f"{CYCLES}:")
        return VariantFacts(
            renderer=CYCLES,
            own_name=device,
            seeds="sequences",
            renders_zones=False,
            on_gpu=device != "cpu",
            is_confined=device == "cpu",
            works_everywhere=device == "cpu",
            package="bpy",
        )
    if shown.startswith("scalar"):
        return VariantFacts(
            renderer=MITSUBA,
            own_name=shown,
            seeds="scalar",
            renders_in_parts=False,
            renders_zones=False,
            works_everywhere=True,
            package=MITSUBA,
        )
    return VariantFacts(
        renderer=MITSUBA, own_name=shown, on_gpu=shown.startswith("cuda"), package=MITSUBA
    )


VARIANTS: Final[dict[RenderVariant, VariantFacts]] = {
    shown: _facts(shown) for shown in get_args(RenderVariant)
}


def shown_name(variant: str) -> str:
    """Return a variant's stored and shown name; an unknown name stays as it is.

    Examples
    --------
    >>> shown_name("mitsuba:llvm_ad_rgb")
    'llvm_ad_rgb'
    """
    return variant.removeprefix(f"{MITSUBA}:")


def variant_named(name: str) -> VariantFacts:
    """Return the farm's facts of a variant, by its stored and shown name.

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
    """Return the variant of a job of this renderer's scene, by the variant asked for.

    Mitsuba's ``auto`` stays: the first worker decides. For other renderers it is their first one.

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
