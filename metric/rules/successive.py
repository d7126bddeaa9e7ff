"""Algorithm 4.2 of the paper: compare each image with the one before it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

from plateau.metric.rules.base import Memory, Rule, Verdict
from plateau.metric.rules.earlier import EarlierImages, differing_pixels, first_verdict, verdict_on

if TYPE_CHECKING:
    from plateau.metric.rules.evidence import Evidence


@dataclass(kw_only=True)
class Successive(Rule):
    """Stops when the newest samples changed nothing visible: D(I_n-step, I_n) ≤ threshold.

    It depends on the step, as the paper shows and `docs/stopping.md` measures: a small one changes
    nothing that can be seen, however noisy the image is.

    Notes
    -----
    The paper stops where the differences "become null". Here the threshold is in visible pixels at
    512×512, scales with the pixel count and is never under one pixel, so that no single one can
    hold up an image. Pixels that are NaN or infinite are left out.

    It stores one image, the one before.

    References
    ----------
    N. Takouachet, S. Delepoulle and C. Renaud, A perceptual stopping condition for global
    illumination computations, SCCG 2007, section 4.1 (step 50 or 100 spp).
    """

    name: ClassVar[str] = "successive"
    summary: ClassVar[str] = (
        "Stop when an image hardly differs from the one before it (algorithm 4.2)."
    )
    title: ClassVar[str] = "One step to the next"
    help: ClassVar[str] = (
        "Stops when an image hardly differs from the one a step before; easily fooled by small "
        "steps."
    )
    criterion: ClassVar[str] = "D(I_n−step, I_n) ≤ `threshold`"
    stores: ClassVar[str] = "one image"
    order: ClassVar[int] = 2

    #: Visible pixels at 512×512 that may still change.
    threshold: float = differing_pixels()

    _earlier: EarlierImages = field(
        default_factory=EarlierImages, init=False, repr=False, compare=False
    )

    def judge(self, evidence: Evidence) -> Verdict:
        """Return whether nothing has changed; the value is how many pixels visibly did."""
        self._earlier.require_before(evidence)
        before = self._earlier.spps
        if before:
            earlier = evidence.metric.percept(self._earlier[before[0]])
            verdict = verdict_on(
                evidence,
                before[0],
                evidence.metric.compare(earlier, evidence.percept),
                self.threshold,
                f"the image at {before[0]} spp",
            )
        else:
            words = f"the image at {evidence.spp} spp is the first; there is none before it"
            verdict = first_verdict(evidence, self.threshold, words)
        self._earlier.forget(before)
        self._earlier.add(evidence)
        return verdict

    def stored_images(self, evaluations: int) -> int:
        """Return 1, the image before, as soon as there is one."""
        return min(evaluations, 1)

    def memory(self) -> Memory:
        """Return the image before."""
        return self._earlier.memory()

    def recall(self, memory: Memory) -> None:
        """Take up the image before."""
        earlier = EarlierImages.of(memory)
        if earlier is None or len(earlier.spps) > 1:
            raise ValueError("not a memory of the rule 'successive'")
        self._earlier = earlier
