"""Algorithm 4.4 of the paper, the reverse comparison, after which Plateau is named.

The first image stays the reference. The more the merged image improves, the more it differs from
the noisy first one. When the count of visible pixels has risen to its plateau, more samples change
nothing visible.

Every later image contains the samples of the first. Against an independent reference the curve
would fall.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

from plateau.metric.rules.base import Memory, Rule, Verdict, points_in, require_later
from plateau.metric.rules.line import least_squares_slope
from plateau.metric.rules.reasons import darkness
from plateau.rules import PAPER_PIXELS, ParameterRole, parameter

if TYPE_CHECKING:
    from plateau.metric.display import Image
    from plateau.metric.rules.base import Json
    from plateau.metric.rules.evidence import Evidence
    from plateau.metric.vdp import Percept


@dataclass(kw_only=True)
class Reverse(Rule):
    """Stops when the curve of D(I_first, I_n) over n has levelled off.

    I_first is the image of the first evaluation. The slope is that of a least-squares line through
    the last `window` points (n, D), n > first; the rule stops when it is at most ε. The comparison
    of I_first with itself is no point of the curve: the paper renders its window after the
    reference, and the certain 0 would tilt the first line.

    Notes
    -----
    The paper gives ε no unit. Here it is visible pixels per sample per pixel at 512×512, and it
    scales with the pixel count: an image of W×H pixels stops at a slope of
    ``epsilon`` · W·H / 512². So the same noise stops at the same spp at any size.

    Pixels that are NaN or infinite are left out. It stores one image, the first.

    References
    ----------
    N. Takouachet, S. Delepoulle and C. Renaud, A perceptual stopping condition for global
    illumination computations, SCCG 2007, section 4.4 (N = 5, ε = 0.1, step and I_first 100 spp).
    """

    name: ClassVar[str] = "reverse"
    title: ClassVar[str] = "The paper's plateau"
    help: ClassVar[str] = (
        "Stops when the count of pixels that have changed since the first image no longer rises."
    )
    order: ClassVar[int] = 4
    featured: ClassVar[bool] = True
    continues: ClassVar[bool] = True  # every job's judge keeps one, for the curve

    #: N: how many points the line is laid through.
    window: int = parameter(
        5,
        2,
        1000,
        description="points of the curve in the regression",
        label="Points in the line",
        help="How many points of the curve the slope is taken over.",
        role=ParameterRole.WINDOW,
        option=True,
    )
    #: ε: visible pixels per spp at 512×512; at 0 the curve must not rise at all.
    epsilon: float = parameter(
        0.1,
        0,
        PAPER_PIXELS,
        description="slope, in changed pixels per spp at 512×512, at which to stop",
        label="Slope to stop at",
        unit="px/spp at 512²",
        help="Smaller is stricter.",
        role=ParameterRole.SLOPE,
        option=True,
    )

    _first_spp: int | None = field(default=None, init=False, repr=False, compare=False)
    _first_image: Image | None = field(default=None, init=False, repr=False, compare=False)
    _first_percept: Percept | None = field(default=None, init=False, repr=False, compare=False)
    #: The last `window` points of the curve: spp and visible pixels.
    _points: list[tuple[int, float]] = field(
        default_factory=list, init=False, repr=False, compare=False
    )

    def judge(self, evidence: Evidence) -> Verdict:
        """Return whether the curve has levelled off; the value is its slope."""
        # The first image becomes the reference; every later one makes a point of the curve.
        reference, first_spp = self._reference(evidence)
        difference = evidence.metric.compare(reference, evidence.percept)
        visible, pixels = difference.visible, difference.finite_count
        if difference.non_finite:  # more samples do not change these pixels
            visible = visible & evidence.finite
        if evidence.spp > first_spp:
            self._points = [*self._points, (evidence.spp, pixels)][-self.window :]

        slope = least_squares_slope(self._points) if len(self._points) == self.window else None
        epsilon = self.epsilon * evidence.pixels / PAPER_PIXELS
        return Verdict(
            stop=slope is not None and slope <= epsilon,
            value=slope,
            limit=epsilon,
            numbers={
                "visible_pixels": float(pixels),
                "visible_fraction": pixels / evidence.pixels,
                "slope": slope,
                "epsilon": epsilon,
                "window": float(self.window),
                "first_spp": float(first_spp),
                "non_finite_pixels": float(difference.non_finite),
            },
            reason=self._reason(evidence, slope, epsilon),
            visible=visible,
        )

    def memory(self) -> Memory:
        """Return the first image, its spp, and the last points of the curve."""
        if self._first_image is None:
            return Memory()
        points: list[Json] = [[spp, pixels] for spp, pixels in self._points]
        return Memory(
            {"first_spp": self._first_spp, "points": points}, {"first": self._first_image}
        )

    def recall(self, memory: Memory) -> None:
        """Restore the first image and the points; of these, no more than the window holds."""
        self._first_spp, self._first_image, self._first_percept, self._points = None, None, None, []
        if memory.numbers or memory.images:
            self._first_spp, self._first_image, self._points = self._parse(memory)

    def _reference(self, evidence: Evidence) -> tuple[Percept, int]:
        """Return the percept and the spp of the first image; the first evidence provides it."""
        if self._first_image is None or self._first_spp is None:
            self._first_spp = evidence.spp
            self._first_image = evidence.kept_image
        else:
            require_later(evidence.spp, self._points[-1][0] if self._points else self._first_spp)
        # Of the kept image, because a percept may read its image only when it is compared.
        if self._first_percept is None:
            self._first_percept = evidence.metric.percept(self._first_image)
        return self._first_percept, self._first_spp

    def _parse(self, memory: Memory) -> tuple[int, Image, list[tuple[int, float]]]:
        from plateau.metric.display import as_image

        match memory.numbers:
            case {"first_spp": int(first_spp), "points": list(rows)} if "first" in memory.images:
                if (points := points_in(rows)) is not None:
                    first = as_image(memory.images["first"]).copy()
                    return first_spp, first, points[-self.window :]
        raise ValueError("not a memory of the rule 'reverse'")

    def _reason(self, evidence: Evidence, slope: float | None, epsilon: float) -> str:
        if not self._points:
            return f"the image at {self._first_spp} spp is the first, against which others are seen"
        if slope is None:
            return f"the curve has {len(self._points)} of the {self.window} points of a slope"
        if not any(pixels for _, pixels in self._points):
            why = darkness(evidence) or "the first image already looked like the present one"
            return (
                f"nothing has changed visibly since the image at {self._first_spp} spp "
                f"on any of the last {self.window} points, slope 0: {why}"
            )
        measured = f"slope {slope:.4g} changed pixels per spp over the last {self.window} points"
        if slope <= epsilon:
            return f"the curve has levelled off: {measured}, at most ε = {epsilon:.4g}"
        return f"the curve still climbs: {measured}, above ε = {epsilon:.4g}"
