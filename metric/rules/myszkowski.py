"""Myszkowski's comparison with the image of half the samples."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

from plateau.metric.rules.base import Memory, Rule, Verdict
from plateau.metric.rules.earlier import EarlierImages, differing_pixels, first_verdict, verdict_on
from plateau.rules import parameter

if TYPE_CHECKING:
    from plateau.metric.rules.evidence import Evidence


@dataclass(kw_only=True)
class Myszkowski(Rule):
    """Stops when the image looks like that of half its samples: D(I_αn, I_n) ≈ 0, α = 0.5.

    With α = 0.5 the two differ with the variance that separates I_n from the converged image, so
    the count stands for the one that nobody can take.

    Notes
    -----
    "≈ 0" is a threshold in visible pixels at 512×512, which scales with the pixel count and is
    never under one pixel. Pixels that are NaN or infinite are left out.

    Where there is no image at exactly αn, as at every odd multiple of the step, the newest one
    before it stands in. It differs a little more, so that errs on the side of more samples. The
    paper seems to have judged at even multiples alone: all its stops are multiples of 200 spp.

    It stores every image from αn on: half as many as there were evaluations, 50 at 10000 spp and a
    step of 100. The rule `visible` asks the same question without them.

    References
    ----------
    K. Myszkowski, The visible differences predictor: applications to global illumination problems,
    Eurographics Rendering Workshop 1998.
    N. Takouachet, S. Delepoulle and C. Renaud, A perceptual stopping condition for global
    illumination computations, SCCG 2007, section 4.3 (α = 0.5, step 100 spp).
    """

    name: ClassVar[str] = "myszkowski"
    summary: ClassVar[str] = (
        "Stop when the image hardly differs from the one at a share of its samples (1998)."
    )
    title: ClassVar[str] = "Half against whole"
    help: ClassVar[str] = (
        "Stops when the image hardly differs from the one at a share of its samples."
    )
    criterion: ClassVar[str] = "D(I_αn, I_n) ≤ `threshold`"
    stores: ClassVar[str] = "images back to αn"
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

    _earlier: EarlierImages = field(
        default_factory=EarlierImages, init=False, repr=False, compare=False
    )

    def judge(self, evidence: Evidence) -> Verdict:
        """Return whether the two look alike; the value is by how many pixels they do not."""
        self._earlier.require_before(evidence)
        candidates = [spp for spp in self._earlier.spps if spp <= self.alpha * evidence.spp]
        if candidates:
            earlier = evidence.metric.percept(self._earlier[candidates[-1]])
            verdict = verdict_on(
                evidence,
                candidates[-1],
                evidence.metric.compare(earlier, evidence.percept),
                self.threshold,
                f"the image at {candidates[-1]} spp ({candidates[-1] / evidence.spp:.2g} of them)",
            )
        else:
            words = f"there is no image of {self.alpha:g} times {evidence.spp} spp or fewer"
            verdict = first_verdict(evidence, self.threshold, words)
        self._earlier.forget(candidates[:-1])
        self._earlier.add(evidence)
        return verdict

    def stored_images(self, evaluations: int) -> int:
        """Return how many images there are from αn on, the last at or before it included."""
        return evaluations - max(math.floor(self.alpha * evaluations) - 1, 0)

    def memory(self) -> Memory:
        """Return the images from αn on."""
        return self._earlier.memory()

    def recall(self, memory: Memory) -> None:
        """Take up the images of an earlier rule of the same α."""
        earlier = EarlierImages.of(memory)
        if earlier is None:
            raise ValueError("not a memory of the rule 'myszkowski'")
        self._earlier = earlier
