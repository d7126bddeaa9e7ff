"""Algorithm 4.3 of the paper: compare each image with a whole window of earlier ones."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

from plateau.metric.rules.base import Memory, Rule, Verdict
from plateau.metric.rules.earlier import (
    EarlierImages,
    allowed_pixels,
    differing_pixels,
    first_verdict,
    verdict_on,
)
from plateau.rules import parameter

if TYPE_CHECKING:
    from plateau.metric.rules.evidence import Evidence
    from plateau.metric.vdp import Difference


@dataclass(kw_only=True)
class Multiple(Rule):
    """Stops when no image of the window differs visibly from the one after it.

    That is when all of D(I_m, R), …, D(I_m+w-1, R) ≤ threshold, where R is the image after the
    window. The window then moves on by one image: the paper's own stops, such as 1700, 1900 and
    2100 spp at a step of 100, cannot come from windows laid end to end.

    Notes
    -----
    The threshold is in visible pixels at 512×512, scales with the pixel count and is never under
    one pixel. Pixels that are NaN or infinite are left out.

    The oldest image differs most, so the window is gone through from there and no further than the
    first one above the threshold, as in the paper's loop: w comparisons are paid only at a stop.

    It stores w images, the window.

    References
    ----------
    N. Takouachet, S. Delepoulle and C. Renaud, A perceptual stopping condition for global
    illumination computations, SCCG 2007, section 4.2 (window 5 or 8, step 50 or 100 spp).
    """

    name: ClassVar[str] = "multiple"
    summary: ClassVar[str] = (
        "Stop when the last images hardly differ from the newest (algorithm 4.3)."
    )
    title: ClassVar[str] = "Several steps back"
    help: ClassVar[str] = "Stops when the last few images hardly differ from the newest."
    criterion: ClassVar[str] = (
        "all of D(I_m, R), …, D(I_m+w−1, R) ≤ `threshold`, R the image after the window"
    )
    stores: ClassVar[str] = "`window` images"
    order: ClassVar[int] = 3

    #: w: how many images the window holds.
    window: int = parameter(
        5,
        1,
        1000,
        description="earlier images that are compared",
        label="Images compared",
        help="How many earlier ones.",
    )
    #: Visible pixels at 512×512 by which any of them may still differ.
    threshold: float = differing_pixels()

    _earlier: EarlierImages = field(
        default_factory=EarlierImages, init=False, repr=False, compare=False
    )

    def judge(self, evidence: Evidence) -> Verdict:
        """Return whether the whole window looks like the image after it.

        The value is the visible pixels against the first image of the window above the threshold,
        or, where there is none, the most against any.
        """
        self._earlier.require_before(evidence)
        verdict = self._verdict(evidence)
        self._earlier.add(evidence)
        self._earlier.forget(self._earlier.spps[: -self.window])
        return verdict

    def stored_images(self, evaluations: int) -> int:
        """Return the window, once there are images enough."""
        return min(evaluations, self.window)

    def memory(self) -> Memory:
        """Return the images of the window."""
        return self._earlier.memory()

    def recall(self, memory: Memory) -> None:
        """Take up the images of an earlier rule of the same window."""
        earlier = EarlierImages.of(memory)
        if earlier is None or len(earlier.spps) > self.window:
            raise ValueError(f"not a memory of the rule 'multiple' with a window of {self.window}")
        self._earlier = earlier

    def _verdict(self, evidence: Evidence) -> Verdict:
        spps = self._earlier.spps
        if len(spps) < self.window:
            words = f"there are {len(spps)} of the {self.window} images of a window"
            return first_verdict(evidence, self.threshold, words)

        metric, allowed = evidence.metric, allowed_pixels(self.threshold, evidence.pixels)
        seen: dict[int, Difference] = {}
        for spp in spps:
            seen[spp] = metric.compare(metric.percept(self._earlier[spp]), evidence.percept)
            if seen[spp].finite_count > allowed:
                break
        worst = max(seen, key=lambda spp: seen[spp].finite_count)
        which = f"the image at {worst} spp"
        if self.window > 1 and seen[worst].finite_count <= allowed:
            which = f"any of the last {self.window} images, {spps[0]} to {spps[-1]} spp"
        return verdict_on(evidence, worst, seen[worst], self.threshold, which)
