"""The renderers of the farm and their variants, as the whole farm knows them.

A renderer is a program that renders slices. A variant is one way in which it draws samples: two
variants draw different samples of a scene, so a job keeps to one. A variant's full name is
``RENDERER:VARIANT``. Mitsuba's variants are stored and shown without ``mitsuba:``, and accepted
with it or without. All others are named in full.

A renderer is known by one object, its `RendererFacts`, which an installed distribution names in the
entry point group `plateau.renderers`; Plateau's own are installed in the same way. The object
imports nothing but this module: it names by strings what an API needs to check a scene, and what a
worker needs to render one. ``docs/renderers.md`` says what a new renderer needs.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from types import MappingProxyType
from typing import Final, Literal

from plateau.extensions import offered

#: The entry point group of renderers.
GROUP: Final = "plateau.renderers"
#: The renderer whose variants have short names, and whose ``auto`` its first worker decides.
MITSUBA: Final = "mitsuba"
#: Why other variants than scalar ones cannot render a scene.
WHOLE: Final = (
    "the integrator 'stokes' renders whole films alone, which the farm leaves to Mitsuba in scalar "
    "variants: choose the variant scalar_spectral_polarized, or take the integrator inside it"
)
#: The variant of a job that names none.
AUTO: Final = "auto"


@dataclass(frozen=True, kw_only=True)
class VariantFacts:
    """The farm's facts of a variant."""

    own_name: str  #: the renderer's own name of the variant
    #: seeds of independent samples (`plateau.farm.model.seeds`): any distinct ones, those of
    #: Mitsuba's scalar variants, or places in sequences of samples
    seeds: Literal["distinct", "scalar", "sequences"] = "distinct"
    renders_in_parts: bool = True  #: pass by parts, so that a pass may have any number of samples
    renders_zones: bool = True  #: parts of a film, as jobs that are allocated by zones need them
    on_gpu: bool = False  #: whether it renders on a GPU
    is_confined: bool = True  #: whether its render child is; not where nobody has tried it
    works_everywhere: bool = False  #: wherever its renderer's package is: no worker need try it
    driver: str = ""  #: how the name begins of a system's library without which no worker tries it
    renderer: str = ""  #: the renderer's name, which `RendererFacts` sets

    @property
    def backend(self) -> str:
        """The variant's compiler or runtime: where one variant of a backend works, all do."""
        return f"{self.renderer}:{self.own_name.partition('_')[0]}"


@dataclass(frozen=True, kw_only=True)
class Program:
    """A program that brings a Python of its own, and in it a renderer's package."""

    name: str  #: on the PATH
    #: with which it runs a Python file; ``--``, this Python's version and folders of packages,
    #: ``--``, a module and its arguments follow
    arguments: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class RendererFacts:
    """The farm's facts of a renderer."""

    name: str
    #: the first is that of a job that names none
    variants: tuple[VariantFacts, ...]
    help: str  #: the variants in the help of ``--variant``
    #: ``MODULE:NAME`` of its `plateau.farm.bundle.formats.SceneFormat`
    scenes: str
    #: ``MODULE:NAME`` of its class that fits `plateau.worker.renderers.contract.Renderer`, which
    #: only render children import
    child: str
    package: str = ""  #: the Python package that it needs; "" where Plateau's own suffice
    program: Program | None = None  #: what may bring the package instead
    missing: str = ""  #: what to do on a machine that lacks it
    #: a module that prints the devices that a machine has for its variants on GPUs, a JSON object
    #: of lists of names by a variant's own name; "" for none
    devices: str = ""
    order: int = 100  #: renderers are listed by rising order

    def __post_init__(self) -> None:
        own = tuple(replace(one, renderer=self.name) for one in self.variants)
        object.__setattr__(self, "variants", own)


@cache
def renderers() -> Mapping[str, RendererFacts]:
    """Return the installed renderers by name, sorted by their `order`.

    Raises
    ------
    ImportError
        A renderer cannot be loaded, is no `RendererFacts`, or has the name of another.
    """
    found: dict[str, RendererFacts] = {}
    for entry, one in offered(GROUP):
        if not isinstance(one, RendererFacts):
            raise ImportError(f"the renderer {entry.name} ({entry.value}) is no RendererFacts")
        if one.name != entry.name:
            raise ImportError(f"the renderer {entry.name} ({entry.value}) calls itself {one.name}")
        if found.setdefault(one.name, one) is not one:
            raise ImportError(f"two renderers are called {one.name}; uninstall one of them")
    if MITSUBA not in found:
        raise ImportError("Plateau's own renderers are not installed: install the package again")
    return MappingProxyType(dict(sorted(found.items(), key=lambda one: (one[1].order, one[0]))))


@cache
def variants() -> Mapping[str, VariantFacts]:
    """Return the variants of the installed renderers by their stored and shown names."""
    return MappingProxyType(
        {
            shown_name(f"{renderer.name}:{one.own_name}"): one
            for renderer in renderers().values()
            for one in renderer.variants
        }
    )


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
    known = variants().get(name)
    if known is None:
        raise ValueError(f"there is no variant {name!r}; there are {', '.join(variants())}")
    return known


def renderer_of(variant: str) -> RendererFacts:
    """Return the farm's facts of a variant's renderer; raises as `variant_named` does."""
    return renderers()[variant_named(variant).renderer]


def variant_for(asked: str, renderer: str, *, is_whole: bool = False) -> str:
    """Return the variant of a job of this renderer's scene, by the variant asked for.

    Mitsuba's ``auto`` stays: the first worker decides. For other renderers it is their first one.
    A scene that `is_whole` needs a scalar variant.

    Raises
    ------
    ValueError
        It cannot render the scene; the message says what to do.
    """
    if is_whole and (asked == AUTO or variants()[asked].seeds != "scalar"):
        raise ValueError(WHOLE)
    own = [name for name, known in variants().items() if known.renderer == renderer]
    if asked == AUTO:
        return AUTO if renderer == MITSUBA else own[0]
    if asked in own:
        return asked
    raise ValueError(
        f"the scene is one for the renderer {renderer}, which has no variant {asked}; leave the "
        f"variant out, or name {' or '.join(own)}"
    )
