"""Algorithm 4.2 of the paper: compare each image with the one before it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from plateau.metric.rules.earlier import RuleOverEarlierImages, differing_pixels

if TYPE_CHECKING:
    from plateau.metric.rules.base import Verdict
    from plateau.metric.rules.evidence import Evidence


@dataclass(kw_only=True)
class Successive(RuleOverEarlierImages):
    """Stops when the newest samples changed nothing visible: D(I_n-step, I_n) ≤ threshold.

    It depends on the step, as the paper shows and `docs/science/stopping.md` measures: a small step
    changes nothing visible, however noisy the image is.

    Notes
    -----
    The paper stops where the differences "become null". Here the threshold is in visible pixels at
    512×512, scales with the pixel count and is at least one pixel. Pixels not finite are left out.

    It stores one image, that of the evaluation before.

    References
    ----------
    N. Takouachet, S. Delepoulle and C. Renaud, A perceptual stopping condition for global
    illumination computations, SCCG 2007, section 4.1 (step 50 or 100 spp).
    """

    name: ClassVar[str] = "successive"
    title: ClassVar[str] = "One step to the next"
    help: ClassVar[str] = (
        "Stops when an image hardly differs from the one a step before; easily fooled by small "
        "steps."
    )
    order: ClassVar[int] = 2

    #: Visible pixels at 512×512 that may still change.
    threshold: float = differing_pixels()

    def judge(self, evidence: Evidence) -> Verdict:
        """Return whether nothing has changed; the value is the pixels that visibly changed."""
        before = self._spps_before(evidence)
        if before:
            difference = self._difference(evidence, before[0])
            seen_from = f"the image at {before[0]} spp"
            verdict = self._verdict_on(evidence, before[0], difference, seen_from)
        else:
            words = f"the image at {evidence.spp} spp is the first; there is none before it"
            verdict = self._first_verdict(evidence, words)
        self._keep(evidence, without=before)
        return verdict
