"""The shared part of the rules that compare the merged image with earlier ones."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from plateau.metric.rules.base import Memory, Rule, Verdict, require_later
from plateau.metric.rules.reasons import counted, darkness, left_out
from plateau.rules import PAPER_PIXELS, parameter

if TYPE_CHECKING:
    from plateau.metric.display import Image
    from plateau.metric.rules.base import Json
    from plateau.metric.rules.evidence import Evidence
    from plateau.metric.vdp import Difference


@dataclass(kw_only=True)
class RuleOverEarlierImages(Rule):
    """A rule whose memory is merged images of earlier evaluations."""

    if TYPE_CHECKING:
        threshold: float  #: of each such rule, in visible pixels at 512×512

    #: By their samples per pixel, oldest first.
    _images: dict[int, Image] = field(default_factory=dict, init=False, repr=False, compare=False)

    def memory(self) -> Memory:
        """Return the earlier images that later verdicts need, each named by its spp."""
        if not self._images:
            return Memory()
        spps: list[Json] = list(self._images)
        return Memory({"spp": spps}, {str(spp): image for spp, image in self._images.items()})

    def recall(self, memory: Memory) -> None:
        """Restore the images of an earlier rule with the same parameters."""
        from plateau.metric.display import as_image

        rows = memory.numbers.get("spp")
        spps = [row for row in rows if isinstance(row, int)] if isinstance(rows, list) else []
        is_ours = memory.numbers in ({}, {"spp": spps}) and spps == sorted(set(spps))
        if not is_ours or {*map(str, spps)} != {*memory.images}:
            raise ValueError(f"not a memory of the rule {self.name!r}")
        self._images = {spp: as_image(memory.images[str(spp)]).copy() for spp in spps}

    def _spps_before(self, evidence: Evidence) -> list[int]:
        """Return the spp of the earlier images, ascending.

        Raises ValueError unless this evaluation is later than all of them and of their size.
        """
        spps = list(self._images)
        if spps:
            from plateau.metric.display import as_image

            require_later(evidence.spp, spps[-1])
            ours, theirs = self._images[spps[-1]].shape[:2], as_image(evidence.image).shape[:2]
            if ours != theirs:
                raise ValueError(
                    f"an image of {theirs[1]}×{theirs[0]} pixels came after "
                    f"one of {ours[1]}×{ours[0]} pixels"
                )
        return spps

    def _keep(self, evidence: Evidence, *, without: list[int]) -> None:
        """Keep the merged image of this evaluation, and drop the images at these spp."""
        self._images[evidence.spp] = evidence.kept_image
        for spp in without:
            del self._images[spp]

    def _difference(self, evidence: Evidence, spp: int) -> Difference:
        """Return the difference from the earlier image at `spp`."""
        earlier = evidence.metric.percept(self._images[spp])
        return evidence.metric.compare(earlier, evidence.percept)

    def _first_verdict(self, evidence: Evidence, words: str) -> Verdict:
        """Return the verdict where there are too few earlier images yet; `words` is its reason."""
        return Verdict(
            stop=False,
            value=None,
            numbers={
                "visible_pixels": None,
                "visible_fraction": None,
                "allowed_pixels": allowed_pixels(self.threshold, evidence.pixels),
                "compared_spp": None,
                "non_finite_pixels": None,
            },
            reason=words,
        )

    def _verdict_on(
        self, evidence: Evidence, spp: int, difference: Difference, seen_from: str
    ) -> Verdict:
        """Return the verdict on the difference from an earlier image, by its visible pixels.

        Parameters
        ----------
        evidence
            The present evaluation.
        spp
            Samples per pixel of the earlier image.
        difference
            Between the two images.
        seen_from
            The reason's name for the earlier image.
        """
        visible = difference.finite_count
        allowed = allowed_pixels(self.threshold, evidence.pixels)
        stop = visible <= allowed
        verb = "differs" if visible <= 1 else "differ"
        aim = f"{'at most' if stop else 'more than'} {allowed:.4g}"
        reason = f"{counted(visible)} {verb} visibly from {seen_from}, {aim}"
        if visible == 0:
            reason = f"{counted(visible)} {verb} visibly from {seen_from}"
            dark = darkness(evidence)
            if dark is not None:
                reason += f": {dark}"
        return Verdict(
            stop=stop,
            value=float(visible),
            limit=allowed,
            numbers={
                "visible_pixels": float(visible),
                "visible_fraction": visible / evidence.pixels,
                "allowed_pixels": allowed,
                "compared_spp": float(spp),
                "non_finite_pixels": float(difference.non_finite),
            },
            reason=reason + left_out(difference.non_finite),
        )


def differing_pixels() -> float:
    """Return a rule's field for the threshold: visible pixels at 512×512 at which to stop."""
    return parameter(
        1.0,
        0,
        PAPER_PIXELS,
        description="differing pixels at 512×512 at which to stop",
        label="Pixels that may differ",
        unit="at 512²",
        help="Smaller is stricter.",
    )


def allowed_pixels(threshold: float, pixels: int) -> float:
    """Return how many pixels of an image may still differ visibly.

    The threshold holds for 512×512 pixels and scales with their number. The result is at least 1,
    so that a single pixel, such as a firefly, cannot keep a whole image from converging, and less
    than the whole image.

    Examples
    --------
    >>> allowed_pixels(2.0, 1024 * 1024), allowed_pixels(2.0, 64 * 64), allowed_pixels(2.0, 1)
    (8.0, 1.0, 0.0)
    """
    return min(max(1.0, threshold * pixels / PAPER_PIXELS), float(pixels - 1))
