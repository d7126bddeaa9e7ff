"""Plateau's own rule: stop when hardly a pixel is left that a person would see change."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

from metric.estimate import allowed_pixels, require_target
from metric.rules.base import Memory, Rule, Verdict, require_later, require_whole_number
from metric.rules.words import counted, darkness, left_out

if TYPE_CHECKING:
    from metric.rules.base import Evidence


@dataclass(kw_only=True)
class Visible(Rule):
    """Stops when the half-buffer estimate is at most `target` on two consecutive evaluations.

    The estimate says how many pixels a person would see differ from the converged image. Two
    passes and a minimum of samples guard against a lucky look, since looking often is a way of
    stopping early by luck.

    Notes
    -----
    The default target, two pixels in ten thousand, is where the recorded Cornell box stood at about
    1150 spp; half of the paper's observers saw no difference in its BOX 1 from 1193 spp on. The
    target is never less than one pixel. Pixels that are NaN or infinite are left out.

    Light that no path has found yet is invisible to this rule as to every other.

    It stores no image.
    """

    name: ClassVar[str] = "visible"

    #: Share of the pixels that may still differ visibly, between 0 and 1.
    target: float = 0.0002
    #: Samples per pixel before which it does not stop, 1 or more.
    min_spp: int = 200

    _newest_spp: int | None = field(default=None, init=False, repr=False, compare=False)
    #: Whether the estimate was at most the target on the newest evaluation.
    _passed: bool = field(default=False, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        require_target(self.target)
        require_whole_number("min_spp", self.min_spp, least=1)

    def judge(self, evidence: Evidence) -> Verdict:
        """Return whether the target is reached, twice; the value is the estimate's fraction."""
        require_later(evidence.spp, self._newest_spp)
        estimate, allowed = evidence.estimate, allowed_pixels(self.target, evidence.pixels)
        # A sum that is NaN or infinite stays so: nothing to wait for.
        pixels = None if estimate is None else estimate.pixels - estimate.non_finite
        passed = pixels is not None and pixels <= allowed
        stop = passed and self._passed and evidence.spp >= self.min_spp
        verdict = Verdict(
            stop=stop,
            value=None if pixels is None else pixels / evidence.pixels,
            numbers={
                "estimate_pixels": pixels,
                "low_pixels": None if estimate is None else estimate.low_pixels,
                "high_pixels": None if estimate is None else estimate.high_pixels,
                "allowed_pixels": allowed,
                "min_spp": float(self.min_spp),
                "non_finite_pixels": None if estimate is None else estimate.non_finite,
            },
            reason=self._reason(evidence, allowed, passed=passed, stop=stop),
        )
        self._newest_spp, self._passed = evidence.spp, passed
        return verdict

    def stored_images(self, evaluations: int) -> int:  # noqa: ARG002 - part of the interface
        """Return 0: the halves are the monitor's own."""
        return 0

    def memory(self) -> Memory:
        """Return the newest evaluation's spp and whether it passed."""
        if self._newest_spp is None:
            return Memory()
        return Memory({"spp": self._newest_spp, "passed": self._passed})

    def recall(self, memory: Memory) -> None:
        """Take up the newest evaluation of an earlier rule."""
        self._newest_spp, self._passed = None, False
        if not memory.numbers and not memory.images:
            return
        match memory.numbers:
            case {"spp": int(spp), "passed": bool(passed)} if not memory.images:
                self._newest_spp, self._passed = spp, passed
            case _:
                raise ValueError("not a memory of the rule 'visible'")

    def _reason(self, evidence: Evidence, allowed: float, *, passed: bool, stop: bool) -> str:
        estimate = evidence.estimate
        if estimate is None:
            return "there are no two halves yet to compare"
        pixels = estimate.pixels - estimate.non_finite
        if pixels > 0:
            verb = "differs" if pixels == 1 else "differ"
            words = f"an estimated {counted(pixels)} of {evidence.pixels:,} still {verb} visibly "
        else:
            words = f"by estimate no pixel of {evidence.pixels:,} still differs visibly "
        words += "from the converged image"
        dark = None if pixels > 0 else darkness(evidence)
        words += ("" if dark is None else f", since {dark}") + left_out(estimate.non_finite)

        if not passed:
            return f"{words}; the target is {allowed:.4g}"
        if not self._passed:
            return (
                f"{words}; the target of {allowed:.4g} is reached once, and must be twice in a row"
            )
        if not stop:
            return (
                f"{words}; the target of {allowed:.4g} is reached, but not yet {self.min_spp} spp"
            )
        spps = f"{self._newest_spp} and {evidence.spp} spp"
        return f"{words}; the target of {allowed:.4g} is reached at {spps}"
