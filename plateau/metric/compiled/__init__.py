"""The predictor as compiled kernels, for comparing many images.

Its import loads a compiler, and a single comparison should not wait for that: hence a package of
its own. The reference is `plateau.metric.vdp`, in plain numpy.

The reasons for its speed, by weight: the threshold elevation is computed only where it decides
(`elevation`); masking takes three powers for all bands (`elevation`); one pass goes over the rows,
with the blurred rows in rings that stay in cache (`levels`); logarithms and powers are polynomials
in short loops, which the compiler vectorises (`arithmetic`).

    predictor   CompiledVisibleDifferences, the class to use
    percept     an image: streamed from its pixels, or kept
    sweep       the pass over the rows, and the decision on each
    levels      a row of one image: light, colour, blurs
    light       radiance to luminance, a* and b*
    threshold   a difference's strength
    denoise     compiled `plateau.metric.denoise`
    elevation   contrast, sensitivity and masking
    arithmetic  log2 and 2^x
    jit         how kernels are compiled
"""

from plateau.metric.compiled.predictor import CompiledVisibleDifferences

__all__ = ["CompiledVisibleDifferences"]
