"""Plateau's rule for the eye of today: stop when ColorVideoVDP finds the image good enough."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

from plateau.metric.rules.base import Memory, Rule, Verdict, require_later
from plateau.metric.rules.reasons import left_out
from plateau.rules import ParameterRole, least_spp, parameter

if TYPE_CHECKING:
    from plateau.metric.quality import Quality
    from plateau.metric.rules.evidence import Evidence

#: The quality of an image in which nobody sees an error, in JOD.
_BEST = 10.0


@dataclass(kw_only=True)
class Jod(Rule):
    """Stops when the quality by ColorVideoVDP is surely at least `target`, in two evaluations.

    The quality is that of the image against the converged one, estimated as the noise left is:
    against the image without its noise. It counts with the least that it is likely to be.

    What is lost, 10 - JOD, falls about as fast as the samples grow at most. So the evaluation
    before says how much is lost at least, and has to be little enough, too: chance stops nothing.

    Notes
    -----
    At 9 JOD three of four people prefer the converged image; a difference of 0.1 is one that hardly
    anybody sees. The model knows the whole view: pixels per degree, white, black and the room.

    Like every other rule, it cannot know of light that no path has found yet. Without any, an image
    is never good enough.

    It stores no image.

    References
    ----------
    R. K. Mantiuk et al., ColorVideoVDP, ACM Transactions on Graphics 43(4), 2024,
    doi:10.1145/3658144.
    """

    name: ClassVar[str] = "jod"
    title: ClassVar[str] = "Good enough for the eye of today"
    help: ClassVar[str] = (
        "Stops when today's model of vision, ColorVideoVDP, finds the image nearly as good as the "
        "converged one, on the display and at the distance of the view."
    )
    order: ClassVar[int] = 7
    featured: ClassVar[bool] = True
    continues: ClassVar[bool] = True
    quantity: ClassVar[str] = "quality"
    unit: ClassVar[str] = "JOD"
    by_quality: ClassVar[bool] = True
    least_side: ClassVar[int] = 4

    #: The quality to reach, in JOD.
    target: float = parameter(
        9.5,
        1.0,
        9.99,
        description="quality against the converged image to reach, in JOD: 10 is the best, and at "
        "9 three of four people prefer the converged image",
        label="Quality to reach",
        unit="JOD",
        help="10: nobody sees a difference. 9: three of four people prefer the converged image.",
        role=ParameterRole.VALUE_TARGET,
    )
    #: Samples per pixel before which it does not stop.
    min_spp: int = least_spp("Guards against an estimate that is high by chance.")

    #: The last evaluation: its spp, and what was lost at most.
    _before: tuple[int, float | None] | None = field(
        default=None, init=False, repr=False, compare=False
    )

    def judge(self, evidence: Evidence) -> Verdict:
        """Return whether the target is reached; the value is the quality in JOD."""
        require_later(evidence.spp, None if self._before is None else self._before[0])
        quality = evidence.quality
        at_least = self._at_least(evidence.spp)
        self._before = evidence.spp, None if quality is None else _BEST - quality.low_jod
        self.foreseen_spp = evidence.quality_forecast(self.target)
        passed = quality is not None and quality.low_jod >= self.target
        likely = at_least is not None and _BEST - at_least >= self.target
        return Verdict(
            stop=passed and likely and evidence.is_lit and evidence.spp >= self.min_spp,
            value=None if quality is None else quality.jod,
            numbers={
                "jod": None if quality is None else quality.jod,
                "low_jod": None if quality is None else quality.low_jod,
                "jod_by_the_last": None if at_least is None else _BEST - at_least,
                "target_jod": self.target,
                "min_spp": float(self.min_spp),
            },
            reason=self._reason(evidence, quality, passed=passed, likely=likely),
        )

    def memory(self) -> Memory:
        """Return the newest evaluation's spp, and what was lost there."""
        if self._before is None:
            return Memory()
        spp, lost = self._before
        return Memory({"spp": spp, "lost": lost})

    def recall(self, memory: Memory) -> None:
        """Restore the last evaluation of an earlier rule."""
        self._before = None
        match memory.numbers:
            case {"spp": int(spp), "lost": (int() | float() | None) as lost} if not memory.images:
                self._before = spp, lost
            case numbers if numbers or memory.images:
                raise ValueError("not a memory of the rule 'jod'")

    def _at_least(self, spp: int) -> float | None:
        """Return what is lost at least, as far as the evaluation before can tell."""
        before_spp, lost = self._before or (spp, None)
        return None if lost is None else lost * before_spp / spp

    def _reason(
        self, evidence: Evidence, quality: Quality | None, *, passed: bool, likely: bool
    ) -> str:
        if quality is None:
            if evidence.halves is None:
                return "there are no two halves yet to compare"
            return "the image is too small for ColorVideoVDP, which needs 4 by 4 pixels"
        words = (
            f"the quality is an estimated {quality.jod:.2f} JOD, and surely {quality.low_jod:.2f}"
        )
        if quality.has_fireflies:
            words += ", as fireflies hide light that the converged image has around them"
        words += left_out(float((~evidence.finite).sum()))
        target = f"the target of {self.target:g} JOD"
        if not evidence.is_lit:
            return "the image is black, and no light is no quality: look at the scene's emitters"
        if evidence.halves_agree:
            words += ", as no sample differs from another: light that none has found is not judged"
        if not passed:
            return f"{words}; the target is {self.target:g} JOD"
        if not likely:
            return f"{words}; {target} is reached, but the evaluation before was too far from it"
        if evidence.spp < self.min_spp:
            return f"{words}; {target} is reached, but not yet {self.min_spp} spp"
        return f"{words}; {target} is reached"
