"""Algorithm 4.3 of the paper: compare each image with a whole window of earlier ones."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from plateau.metric.rules.earlier import RuleOverEarlierImages, allowed_pixels, differing_pixels
from plateau.rules import parameter

if TYPE_CHECKING:
    from plateau.metric.rules.base import Verdict
    from plateau.metric.rules.evidence import Evidence
    from plateau.metric.vdp import Difference


@dataclass(kw_only=True)
class Multiple(RuleOverEarlierImages):
    """Stops when no image of the window differs visibly from the one after it.

    It compares all of D(I_m, R), …, D(I_m+w-1, R) with the threshold; R is the image after the
    window. The window then moves by one image. Windows laid end to end cannot explain the paper's
    stops, such as 1700, 1900 and 2100 spp at a step of 100.

    Notes
    -----
    The threshold is in visible pixels at 512×512, scales with the pixel count and is at least one
    pixel. Pixels that are NaN or infinite are left out.

    The comparisons begin with the oldest image, which differs most, and end at the first image
    above the threshold, as in the paper's loop. So only a stop costs w comparisons.

    It stores w images, the window.

    References
    ----------
    N. Takouachet, S. Delepoulle and C. Renaud, A perceptual stopping condition for global
    illumination computations, SCCG 2007, section 4.2 (window 5 or 8, step 50 or 100 spp).
    """

    name: ClassVar[str] = "multiple"
    title: ClassVar[str] = "Several steps back"
    help: ClassVar[str] = "Stops when the last few images hardly differ from the newest."
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

    def judge(self, evidence: Evidence) -> Verdict:
        """Return whether the whole window looks like the image after it.

        The value is the visible pixels against the first image above the threshold, or the most
        against any image if none is above it.
        """
        spps = self._spps_before(evidence)
        verdict = self._verdict(evidence, spps)
        self._keep(evidence, without=[*spps, evidence.spp][: -self.window])
        return verdict

    def _verdict(self, evidence: Evidence, spps: list[int]) -> Verdict:
        if len(spps) < self.window:
            words = f"there are {len(spps)} of the {self.window} images of a window"
            return self._first_verdict(evidence, words)

        allowed = allowed_pixels(self.threshold, evidence.pixels)
        seen: dict[int, Difference] = {}
        for spp in spps:
            seen[spp] = self._difference(evidence, spp)
            if seen[spp].finite_count > allowed:
                break
        worst = max(seen, key=lambda spp: seen[spp].finite_count)
        which = f"the image at {worst} spp"
        if self.window > 1 and seen[worst].finite_count <= allowed:
            which = f"any of the last {self.window} images, {spps[0]} to {spps[-1]} spp"
        return self._verdict_on(evidence, worst, seen[worst], which)
