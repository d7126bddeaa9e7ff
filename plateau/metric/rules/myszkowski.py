"""Myszkowski's comparison with the image of half the samples."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from plateau.metric.rules.earlier import RuleOverEarlierImages, differing_pixels
from plateau.rules import parameter

if TYPE_CHECKING:
    from plateau.metric.rules.base import Verdict
    from plateau.metric.rules.evidence import Evidence


@dataclass(kw_only=True)
class Myszkowski(RuleOverEarlierImages):
    """Stops when the image looks like that of half its samples: D(I_αn, I_n) ≈ 0, α = 0.5.

    With α = 0.5 the two images differ with the variance that separates I_n from the converged
    image, so the count stands for the difference from the converged image.

    Notes
    -----
    "≈ 0" is a threshold in visible pixels at 512×512, which scales with the pixel count and is at
    least one pixel. Pixels that are NaN or infinite are left out.

    At odd multiples of the step no image has exactly αn spp. The newest image before αn takes its
    place: it differs a little more, which errs on the side of more samples. The paper seems to have
    judged at even multiples alone, because all its stops are multiples of 200 spp.

    It stores every image from αn on, which is half of the evaluations: 50 at 10000 spp and a step
    of 100. The rule `visible` asks the same question without stored images.

    References
    ----------
    K. Myszkowski, The visible differences predictor: applications to global illumination problems,
    Eurographics Rendering Workshop 1998.
    N. Takouachet, S. Delepoulle and C. Renaud, A perceptual stopping condition for global
    illumination computations, SCCG 2007, section 4.3 (α = 0.5, step 100 spp).
    """

    name: ClassVar[str] = "myszkowski"
    title: ClassVar[str] = "Half against whole"
    help: ClassVar[str] = (
        "Stops when the image hardly differs from the one at a share of its samples."
    )
    order: ClassVar[int] = 5

    #: α: the earlier image's share of the samples.
    alpha: float = parameter(
        0.5,
        0.01,
        0.99,
        description="the share of the samples",
        label="Share of the samples",
        help="0.5 compares with half of them.",
    )
    #: Visible pixels at 512×512 by which the two may differ.
    threshold: float = differing_pixels()

    def judge(self, evidence: Evidence) -> Verdict:
        """Return whether the two images look alike; the value is the pixels that differ."""
        spps = self._spps_before(evidence)
        candidates = [spp for spp in spps if spp <= self.alpha * evidence.spp]
        if candidates:
            spp = candidates[-1]
            difference = self._difference(evidence, spp)
            seen_from = f"the image at {spp} spp ({spp / evidence.spp:.2g} of them)"
            verdict = self._verdict_on(evidence, spp, difference, seen_from)
        else:
            words = f"there is no image of {self.alpha:g} times {evidence.spp} spp or fewer"
            verdict = self._first_verdict(evidence, words)
        self._keep(evidence, without=candidates[:-1])
        return verdict
