"""Plateau's own renderers, as the farm knows them: Mitsuba, and the one of analytic scenes."""

from typing import Final

from plateau.farm.model.renderers import RendererFacts, VariantFacts

_RGB: Final = ("scalar_rgb", "llvm_ad_rgb", "cuda_ad_rgb")
_OTHERS: Final = (
    *("scalar_spectral", "scalar_spectral_polarized"),
    *("llvm_ad_mono", "llvm_ad_mono_polarized", "llvm_ad_spectral", "llvm_ad_spectral_polarized"),
    *("cuda_ad_mono", "cuda_ad_mono_polarized", "cuda_ad_spectral", "cuda_ad_spectral_polarized"),
)


def _of_mitsuba(name: str) -> VariantFacts:
    if name.startswith("scalar"):
        return VariantFacts(
            own_name=name,
            seeds="scalar",
            renders_in_parts=False,
            renders_zones=False,
            works_everywhere=True,
        )
    return VariantFacts(own_name=name, on_gpu=name.startswith("cuda"))


MITSUBA: Final = RendererFacts(
    name="mitsuba",
    variants=tuple(map(_of_mitsuba, (*_RGB, *_OTHERS))),
    help="scalar_rgb, llvm_ad_rgb or cuda_ad_rgb; spectral, mono or polarized in the place of rgb "
    "(docs/renderers.md)",
    scenes="plateau.farm.bundle.formats:MITSUBA_XML",
    child="plateau.worker.renderers.mitsuba.renderer:Renderer",
    package="mitsuba",
    missing="Mitsuba is not here; pip install 'plateau[worker]'",
    order=1,
)

ANALYTIC: Final = RendererFacts(
    name="analytic",
    variants=(VariantFacts(own_name="numpy", works_everywhere=True),),
    help="analytic:numpy",
    scenes="plateau.farm.bundle.analytic:ANALYTIC_JSON",
    child="plateau.worker.renderers.analytic.renderer:Renderer",
    order=2,
)
