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


@dataclass(eq=False)
class EarlierImages:
    """Merged images of earlier evaluations by their spp, oldest first."""

    _images: dict[int, Image] = field(default_factory=dict)

    def __getitem__(self, spp: int) -> Image:
        return self._images[spp]

    @property
    def spps(self) -> list[int]:
        """Their samples per pixel, ascending."""
        return list(self._images)

    def require_before(self, evidence: Evidence) -> None:
        """Raise ValueError unless this evaluation is later than all of them and of their size."""
        if not self._images:
            return
        from plateau.metric.display import as_image

        newest = self.spps[-1]
        require_later(evidence.spp, newest)
        ours, theirs = self._images[newest].shape[:2], as_image(evidence.image).shape[:2]
        if ours != theirs:
            raise ValueError(
                f"an image of {theirs[1]}×{theirs[0]} pixels came after "
                f"one of {ours[1]}×{ours[0]} pixels"
            )

    def add(self, evidence: Evidence) -> None:
        """Keep the merged image of this evaluation."""
        self._images[evidence.spp] = evidence.kept_image

    def forget(self, spps: list[int]) -> None:
        """Drop the images at these spp."""
        for spp in spps:
            del self._images[spp]

    def memory(self) -> Memory:
        """Return the images, each named by its spp."""
        if not self._images:
            return Memory()
        spps: list[Json] = list(self.spps)
        return Memory({"spp": spps}, {str(spp): image for spp, image in self._images.items()})

    @classmethod
    def of(cls, memory: Memory) -> EarlierImages | None:
        """Return the images of a memory; None if it holds anything else."""
        if not memory.numbers and not memory.images:
            return cls()
        from plateau.metric.display import as_image

        match memory.numbers:
            case {"spp": list(rows), **others} if not others:
                spps = [row for row in rows if isinstance(row, int)]
                ascending = spps == sorted(set(spps))
                if len(spps) == len(rows) and ascending and {*map(str, spps)} == {*memory.images}:
                    return cls({spp: as_image(memory.images[str(spp)]).copy() for spp in spps})
        return None


@dataclass(kw_only=True)
class RuleOverEarlierImages(Rule):
    """A rule whose memory is merged images of earlier evaluations."""

    _earlier: EarlierImages = field(
        default_factory=EarlierImages, init=False, repr=False, compare=False
    )

    def memory(self) -> Memory:
        """Return the earlier images that later verdicts need."""
        return self._earlier.memory()

    def recall(self, memory: Memory) -> None:
        """Restore the images of an earlier rule with the same parameters."""
        earlier = EarlierImages.of(memory)
        if earlier is None:
            raise ValueError(f"not a memory of the rule {self.name!r}")
        self._earlier = earlier

    def _difference(self, evidence: Evidence, spp: int) -> Difference:
        """Return the difference from the earlier image at `spp`."""
        earlier = evidence.metric.percept(self._earlier[spp])
        return evidence.metric.compare(earlier, evidence.percept)


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


def first_verdict(evidence: Evidence, threshold: float, words: str) -> Verdict:
    """Return the verdict of a rule that has too few earlier images yet; `words` is its reason."""
    return Verdict(
        stop=False,
        value=None,
        numbers={
            "visible_pixels": None,
            "visible_fraction": None,
            "allowed_pixels": allowed_pixels(threshold, evidence.pixels),
            "compared_spp": None,
            "non_finite_pixels": None,
        },
        reason=words,
    )


def verdict_on(
    evidence: Evidence, spp: int, difference: Difference, threshold: float, seen_from: str
) -> Verdict:
    """Return the verdict on the difference from an earlier image; the value is its visible pixels.

    Parameters
    ----------
    evidence
        The present evaluation.
    spp
        Samples per pixel of the earlier image.
    difference
        Between the two images.
    threshold
        In visible pixels at 512×512.
    seen_from
        The reason's name for the earlier image.
    """
    visible = difference.finite_count
    allowed = allowed_pixels(threshold, evidence.pixels)
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
