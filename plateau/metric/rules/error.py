"""Rules for references and data sets: stop when the error of the image is known to be small."""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar, NamedTuple

from plateau.metric.rules.base import Memory, Rule, Verdict
from plateau.metric.rules.reasons import left_out
from plateau.rules import MOST_SPP, ParameterRole, parameter

if TYPE_CHECKING:
    from plateau.metric.rules.evidence import Evidence
    from plateau.metric.standard_error import SquaredError

#: From this share on, the few pixels that hold so much of the error are named fireflies.
_FIREFLIES = 0.1
#: An image without any error has this PSNR, in dB.
_MOST_DB = 200.0


class Reading(NamedTuple):
    """An error in the unit of its rule."""

    value: float
    low: float  #: the interval that holds the truth in 95 of 100 cases
    high: float
    sure: float  #: by the slices that decide: in 97.5 of 100 cases it is no worse


@dataclass(kw_only=True)
class ErrorRule(Rule):
    """Stops when the error of the merged image is surely no more than `target`.

    The error is that of this image against the converged one, which nobody has seen: see
    `plateau.metric.standard_error`. Some samples judge, and others decide.

    Like every other rule, it cannot know of light that no path has found yet. It stores no image.
    """

    featured: ClassVar[bool] = False
    by_quarters: ClassVar[bool] = True

    target: float = 0.0  # each rule has its own
    #: Samples per pixel before which it does not stop.
    min_spp: int = parameter(
        200,
        1,
        MOST_SPP,
        description="fewest samples per pixel at which the rule may stop",
        label="Not before",
        unit="spp",
        help="Guards against light that is found late.",
        role=ParameterRole.LEAST_SPP,
    )

    _expected_spp: int | None = field(default=None, init=False, repr=False, compare=False)

    @abstractmethod
    def _error(self, evidence: Evidence) -> SquaredError:
        """Return the squared error by this rule's weights; the evidence has quarters."""

    @abstractmethod
    def _reading(self, error: SquaredError) -> Reading:
        """Return the error in the rule's unit."""

    @abstractmethod
    def _growth(self, error: float) -> float:
        """Return by what the samples must grow from this error to the target: it falls as 1/n."""

    def judge(self, evidence: Evidence) -> Verdict:
        """Return whether the target is surely reached; the value is the error."""
        self._expected_spp = None
        lacking = _lacking(evidence)
        if lacking:
            return Verdict(stop=False, value=None, numbers={}, reason=lacking)
        error = self._error(evidence)
        reading = self._reading(error)
        growth = self._growth(reading.sure)
        if math.isfinite(growth) and growth * evidence.spp < MOST_SPP:
            self._expected_spp = max(math.ceil(max(growth, 1) * evidence.spp), self.min_spp)
        return Verdict(
            stop=growth <= 1 and evidence.spp >= self.min_spp,
            value=reading.value,
            numbers={
                **{name: _number(one) for name, one in reading._asdict().items()},
                "freedom": error.freedom,
                "few_share": error.few_share,
                "non_finite_pixels": float(error.non_finite),
                "target": self.target,
                "min_spp": float(self.min_spp),
            },
            reason=self._reason(evidence, error, reading, passed=growth <= 1),
        )

    def expected_end_spp(
        self,
        forecast_spp: int | None,  # noqa: ARG002 - that of the noise left
        crossing_spp: int | None = None,  # noqa: ARG002
    ) -> int | None:
        """Return where the error is surely expected to reach the target."""
        return self._expected_spp

    def memory(self) -> Memory:
        """Return nothing: the evidence alone decides."""
        return Memory()

    def recall(self, memory: Memory) -> None:
        """Check that there is nothing to recall."""
        if memory.numbers or memory.images:
            raise ValueError(f"not a memory of the rule {self.name!r}, which remembers nothing")

    def _reason(
        self, evidence: Evidence, error: SquaredError, reading: Reading, *, passed: bool
    ) -> str:
        from plateau.metric.standard_error import FEW

        words = (
            f"the {self.quantity} is {reading.value:.3g} {self.unit} "
            f"(95 %: {reading.low:.3g} to {reading.high:.3g})"
        )
        if error.few_share >= _FIREFLIES:
            few = 100 * max(FEW, 1 / evidence.pixels)
            words += f"; {few:.2g} % of the pixels hold {error.few_share:.0%} of it: fireflies"
        words += left_out(error.non_finite)
        if not passed:
            return f"{words}; the target is {self.target:g}, surely"
        early = "" if evidence.spp >= self.min_spp else f", but not yet {self.min_spp} spp"
        return f"{words}; the target of {self.target:g} is surely reached{early}"


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _lacking(evidence: Evidence) -> str:
    """Return why the error is not known; "" if it is."""
    import numpy as np

    if evidence.quarters is None:
        return "there are no four slices yet to compare"
    has_light = (bool((np.isfinite(one) & (one > 0)).any()) for one in evidence.quarters.means)
    return "" if any(has_light) else "no light has been found yet: the image is black"


@dataclass(kw_only=True)
class Relmse(ErrorRule):
    """Stops by the relative mean squared error, the mean of (image - truth)²/(truth² + 0.01)."""

    name: ClassVar[str] = "relmse"
    summary: ClassVar[str] = "Stop at a relative mean squared error (relMSE, ε = 0.01)."
    title: ClassVar[str] = "A relative error, for references"
    help: ClassVar[str] = (
        "Stops when the relative mean squared error against the converged image is surely small "
        "enough, by independent parts of the samples."
    )
    criterion: ClassVar[str] = "mean of (I_n − I_∞)²/(I_∞² + 0.01) surely ≤ `target`, n ≥ `min_spp`"
    order: ClassVar[int] = 10
    quantity: ClassVar[str] = "squared error"
    unit: ClassVar[str] = "relMSE"

    target: float = parameter(
        0.001,
        1e-12,
        1.0,
        description="relative mean squared error to reach",
        label="Error to reach",
        unit="relMSE",
        help="0.001: a relative error of some 3 %.",
        role=ParameterRole.VALUE_TARGET,
    )

    def _error(self, evidence: Evidence) -> SquaredError:
        from plateau.metric.standard_error import relative, relative_error, squared_error

        assert evidence.quarters is not None
        return squared_error(evidence.quarters, relative, relative_error)

    def _reading(self, error: SquaredError) -> Reading:
        return Reading(error.mean, error.low, error.high, error.sure)

    def _growth(self, error: float) -> float:
        return error / self.target


@dataclass(kw_only=True)
class Rmse(ErrorRule):
    """Stops by the root of the mean squared error of linear radiance."""

    name: ClassVar[str] = "rmse"
    summary: ClassVar[str] = "Stop at a root mean squared error of linear radiance."
    title: ClassVar[str] = "An absolute error, for references"
    help: ClassVar[str] = (
        "Stops when the root mean squared error of radiance against the converged image is surely "
        "small enough, by independent parts of the samples."
    )
    criterion: ClassVar[str] = "√ mean of (I_n − I_∞)² surely ≤ `target`, n ≥ `min_spp`"
    order: ClassVar[int] = 11
    quantity: ClassVar[str] = "RMSE"
    unit: ClassVar[str] = "radiance"

    target: float = parameter(
        0.01,
        1e-9,
        1e6,
        description="root mean squared error to reach, in linear radiance",
        label="Error to reach",
        unit="radiance",
        help="In the units of the image.",
        role=ParameterRole.VALUE_TARGET,
    )

    def _error(self, evidence: Evidence) -> SquaredError:
        from plateau.metric.standard_error import plain, squared_error

        assert evidence.quarters is not None
        return squared_error(evidence.quarters, plain)

    def _reading(self, error: SquaredError) -> Reading:
        return Reading(*map(math.sqrt, (error.mean, error.low, error.high, error.sure)))

    def _growth(self, error: float) -> float:
        return (error / self.target) ** 2


@dataclass(kw_only=True)
class Psnr(ErrorRule):
    """Stops by the peak signal-to-noise ratio of the image as it is shown, in sRGB values."""

    name: ClassVar[str] = "psnr"
    summary: ClassVar[str] = "Stop at a peak signal-to-noise ratio of the displayed image, in dB."
    title: ClassVar[str] = "A PSNR, for references"
    help: ClassVar[str] = (
        "Stops when the peak signal-to-noise ratio of the displayed image against the converged "
        "one is surely high enough, by independent parts of the samples."
    )
    criterion: ClassVar[str] = "PSNR(I_n, I_∞), displayed, surely ≥ `target` dB, n ≥ `min_spp`"
    order: ClassVar[int] = 12
    quantity: ClassVar[str] = "PSNR"
    unit: ClassVar[str] = "dB"

    target: float = parameter(
        40.0,
        5.0,
        120.0,
        description="peak signal-to-noise ratio of the displayed image to reach, in dB",
        label="PSNR to reach",
        unit="dB",
        help="40 dB: an error of 1 % of white.",
        role=ParameterRole.VALUE_TARGET,
    )

    def _error(self, evidence: Evidence) -> SquaredError:
        from plateau.metric.display import displayed, srgb_encoded
        from plateau.metric.standard_error import DISPLAY_ERROR, on_display, squared_error

        quarters, view = evidence.quarters, evidence.metric.view
        assert quarters is not None
        weight = on_display(lambda image: srgb_encoded(displayed(quarters.see(image), view)))
        return squared_error(quarters, weight, lambda _: DISPLAY_ERROR)

    def _reading(self, error: SquaredError) -> Reading:
        return Reading(*map(_decibels, (error.mean, error.high, error.low, error.sure)))

    def _growth(self, error: float) -> float:
        return float(10 ** ((self.target - error) / 10))


def _decibels(error: float) -> float:
    return min(-10 * math.log10(max(error, 1e-30)), _MOST_DB)


@dataclass(kw_only=True)
class Noise(ErrorRule):
    """Stops by the relative standard error of each pixel, at a share of the pixels.

    That of a pixel is the root of its relMSE over its tile of 8 by 8 pixels.
    """

    name: ClassVar[str] = "noise"
    summary: ClassVar[str] = "Stop at a relative standard error that most pixels have at most."
    title: ClassVar[str] = "A noise level"
    help: ClassVar[str] = (
        "Stops when the relative standard error of nearly every pixel is small enough: the noise "
        "level or threshold of other renderers."
    )
    criterion: ClassVar[str] = (
        "the relative standard error is surely ≤ `target` at a `share` of the pixels, n ≥ `min_spp`"
    )
    order: ClassVar[int] = 13
    quantity: ClassVar[str] = "standard error"
    unit: ClassVar[str] = "of the light"

    target: float = parameter(
        0.03,
        1e-6,
        1.0,
        description="relative standard error that pixels may have",
        label="Noise level",
        unit="%",
        scale=0.01,
        help="Of the light of each pixel.",
        role=ParameterRole.VALUE_TARGET,
    )
    #: Of the pixels, which have at most this noise.
    share: float = parameter(
        0.95,
        0.5,
        0.999,
        description="share of the pixels that have at most this noise",
        label="In so many pixels",
        unit="%",
        scale=0.01,
        help="The others may have more.",
    )

    def _error(self, evidence: Evidence) -> SquaredError:
        from plateau.metric.standard_error import relative, squared_error

        assert evidence.quarters is not None
        return squared_error(evidence.quarters, relative)

    def _reading(self, error: SquaredError) -> Reading:
        return Reading(*map(math.sqrt, error.at_share(self.share)))

    def _growth(self, error: float) -> float:
        return (error / self.target) ** 2
