"""The predictor as compiled kernels, for those who compare many images.

It is a package apart because importing it loads a compiler, for which a single comparison should
not wait. `plateau.metric.vdp`, plain numpy, is what it is held to.

What makes it fast, most first: the threshold elevation is worked out only where it decides
(`elevation`); masking needs no more than three powers for all bands (`elevation`); one pass goes
over the rows, with the blurred ones in rings that stay in cache (`levels`); logarithms and powers
are polynomials in short loops that the compiler vectorises (`arithmetic`).

    predictor   CompiledVisibleDifferences, the class to use
    percept     an image: streamed from its pixels, or kept
    sweep       the pass over the rows, and the decision on each
    levels      a row of one image: light, colour, blurs
    light       radiance to luminance, a* and b*
    threshold   a difference's strength
    denoise     what `plateau.metric.denoise` does
    elevation   contrast, sensitivity and masking
    arithmetic  log2 and 2^x
    jit         how kernels are compiled and cached
"""

from plateau.metric.compiled.jit import cache_folder
from plateau.metric.compiled.percept import CompiledPercept
from plateau.metric.compiled.predictor import CompiledVisibleDifferences

__all__ = ["CompiledPercept", "CompiledVisibleDifferences", "cache_folder"]
