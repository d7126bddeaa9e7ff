"""A renderer from outside Plateau; the folder above is what its installation would leave."""

from plateau.farm.model.renderers import RendererFacts, VariantFacts

TOY = RendererFacts(
    name="toy",
    variants=(VariantFacts(own_name="plain"),),
    help="toy:plain",
    scenes="toy_renderer.scenes:TOY_FILE",
    child="toy_renderer.renderer:Renderer",
)
