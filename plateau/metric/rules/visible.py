"""Plateau's own rule: stop when hardly a pixel would still change visibly."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

from plateau.metric.rules.base import Memory, Rule, Verdict, points_in, require_later
from plateau.metric.rules.line import power_law_at_the_end
from plateau.metric.rules.reasons import counted, darkness, left_out
from plateau.rules import ParameterRole, least_spp, parameter

if TYPE_CHECKING:
    from plateau.metric.rules.base import Json
    from plateau.metric.rules.evidence import Evidence

#: Any line through fewer points meets all of them.
LEAST_POINTS = 3
#: The estimate is a mean of two counts: nothing between this and no pixel can be measured.
LEAST_COUNT = 0.5


@dataclass(kw_only=True)
class Visible(Rule):
    """Stops when the half-buffer estimate and its trend are at most `target`.

    The estimate is the number of pixels that differ visibly from the converged image. Its trend is
    the power law through the evaluations since half the samples. With frequent evaluations one of
    them may be low by chance; the trend guards against that, and costs no further evaluation. While
    there are only two evaluations, both must pass.

    Where the samples do not tell yet how wrong a denoiser is, the estimate is undetermined, and the
    rule goes on.

    Notes
    -----
    The recorded Cornell box reached the default target, two pixels in ten thousand, at about 1150
    spp; half of the paper's observers saw no difference in its BOX 1 from 1193 spp on. Where the
    target is less than the estimate can tell, half a pixel, no pixel may differ. Pixels that are
    NaN or infinite are left out.

    Like every other rule, it cannot know of light that no path has found yet.

    It stores no image.
    """

    name: ClassVar[str] = "visible"
    title: ClassVar[str] = "No noise left to see"
    help: ClassVar[str] = (
        "Stops when hardly any noise is left: pixels that would still change visibly if it went "
        "on, estimated from two halves of the samples."
    )
    order: ClassVar[int] = 6
    featured: ClassVar[bool] = True
    continues: ClassVar[bool] = True  # every job's judge keeps one

    #: Share of the pixels that may still differ visibly.
    target: float = parameter(
        0.0002,
        1e-9,
        0.99,
        description="noise that may be left, as a fraction of the pixels",
        label="Noise that may be left",
        unit="%",
        scale=0.01,
        help="The share of the image that a person might still see change.",
        role=ParameterRole.NOISE_TARGET,
    )
    #: Samples per pixel before which it does not stop.
    min_spp: int = least_spp("Guards against an estimate that is low by chance.")

    _newest_spp: int | None = field(default=None, init=False, repr=False, compare=False)
    #: The points of the trend: spp, and the estimate in pixels.
    _points: list[tuple[int, float]] = field(
        default_factory=list, init=False, repr=False, compare=False
    )

    def judge(self, evidence: Evidence) -> Verdict:
        """Return whether the target is reached; the value is the estimate's fraction."""
        require_later(evidence.spp, self._newest_spp)
        estimate, allowed = evidence.estimate, evidence.allowed_pixels(self.target)
        pixels = None if estimate is None else estimate.pixels
        if pixels is not None:
            self._points = _recent([*self._points, (evidence.spp, pixels)])
        self._newest_spp = evidence.spp
        trend = _trend(self._points)
        passed = pixels is not None and pixels <= allowed
        on_trend = trend is not None and trend <= allowed
        known = estimate is None or estimate.is_determined(allowed)
        return Verdict(
            stop=passed and on_trend and known and evidence.spp >= self.min_spp,
            value=None if pixels is None else pixels / evidence.pixels,
            limit=allowed / evidence.pixels,
            numbers={
                "estimate_pixels": pixels,
                "low_pixels": None if estimate is None else estimate.low_pixels,
                "high_pixels": None if estimate is None else estimate.high_pixels,
                "greatest_pixels": None if estimate is None else estimate.greatest_pixels,
                "trend_pixels": trend,
                "allowed_pixels": allowed,
                "min_spp": float(self.min_spp),
                "non_finite_pixels": None if estimate is None else estimate.non_finite,
            },
            reason=self._reason(evidence, allowed, passed=passed, on_trend=on_trend, known=known),
        )

    def memory(self) -> Memory:
        """Return the newest evaluation's spp and the points of the trend."""
        if self._newest_spp is None:
            return Memory()
        points: list[Json] = [[spp, pixels] for spp, pixels in self._points]
        return Memory({"spp": self._newest_spp, "points": points})

    def recall(self, memory: Memory) -> None:
        """Restore the evaluations of an earlier rule."""
        self._newest_spp, self._points = None, []
        if not memory.numbers and not memory.images:
            return
        match memory.numbers:
            case {"spp": int(spp), "points": list(rows)} if not memory.images:
                if (points := points_in(rows)) is not None:
                    self._newest_spp, self._points = spp, points
                    return
        raise ValueError("not a memory of the rule 'visible'")

    def _reason(
        self, evidence: Evidence, allowed: float, *, passed: bool, on_trend: bool, known: bool
    ) -> str:
        estimate = evidence.estimate
        if estimate is None:
            return "there are no two halves yet to compare"
        pixels = estimate.pixels
        if pixels > 0:
            verb = "differs" if pixels == 1 else "differ"
            words = f"an estimated {counted(pixels)} of {evidence.pixels:,} still {verb} visibly "
        else:
            words = f"by estimate no pixel of {evidence.pixels:,} still differs visibly "
        words += "from the converged image"
        dark = None if pixels > 0 else darkness(evidence)
        words += ("" if dark is None else f", since {dark}") + left_out(estimate.non_finite)

        most = f"{allowed:.4g}"
        if allowed < LEAST_COUNT:
            most += " (none, at this size)"
        target = f"the target of {most}"
        if not passed:
            return f"{words}; the target is {most}"
        if not on_trend:
            return f"{words}; {target} is reached now, but not yet by the trend"
        if not known:
            greatest = counted(estimate.greatest_pixels or 0)
            return (
                f"{words}; {target} is reached, but it is undetermined: {greatest} may differ, as "
                "far as the samples tell how wrong the denoiser is"
            )
        if evidence.spp < self.min_spp:
            return f"{words}; {target} is reached, but not yet {self.min_spp} spp"
        return f"{words}; {target} is reached, and the trend of the last evaluations confirms it"


def _recent(points: list[tuple[int, float]]) -> list[tuple[int, float]]:
    """Return the points since half the samples of the last, at least as many as a line needs."""
    newest, _ = points[-1]
    first = next(index for index, (spp, _) in enumerate(points) if 2 * spp >= newest)
    return points[min(first, max(len(points) - LEAST_POINTS, 0)) :]


def _trend(points: list[tuple[int, float]]) -> float | None:
    """Return the visible pixels by the trend; None with fewer than two points."""
    if len(points) >= LEAST_POINTS:
        return power_law_at_the_end(points)
    return max(count for _, count in points) if len(points) > 1 else None
