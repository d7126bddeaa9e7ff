"""Rules for references and data sets: stop when the error of the image is known to be small."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, NamedTuple

from plateau.metric.rules.base import Rule, Verdict
from plateau.metric.rules.reasons import left_out
from plateau.rules import MOST_SPP, ParameterRole, least_spp, parameter

if TYPE_CHECKING:
    from plateau.metric.rules.evidence import Evidence
    from plateau.metric.standard_error import Quarters, SquaredError

#: From this share on, the few pixels that hold so much of the error are named fireflies.
_FIREFLIES = 0.1


class Reading(NamedTuple):
    """An error in the unit of its rule."""

    value: float
    low: float  #: the interval that holds the truth in 95 of 100 cases
    high: float
    sure: float  #: by the slices that decide: in 97.5 of 100 cases it is no worse


def _target(
    default: float, least: float, most: float, unit: str, what: str, *, scale: float = 1
) -> float:
    """Return the field of what a rule waits for, which is `what`."""
    return parameter(
        default,
        least,
        most,
        description=f"{what} to reach",
        label="To reach",
        unit=unit,
        help=f"{what.capitalize()} against the converged image.",
        role=ParameterRole.VALUE_TARGET,
        scale=scale,
    )


@dataclass(kw_only=True)
class ErrorRule(Rule):
    """Stops when the error of the image against the converged one surely reaches `target`.

    Nobody has seen the converged one, and yet the error of this very image is known: see
    `plateau.metric.standard_error`. Some samples decide, and others say what is reached.

    Like every other rule, it cannot know of light that no path has found yet. It stores no image.
    """

    by_quarters: ClassVar[bool] = True
    is_error: ClassVar[bool] = True
    #: The error in the rule's unit is this power of the squared one.
    power: ClassVar[float] = 0.5

    target: float = 0.0  # each rule has its own
    #: Samples per pixel before which it does not stop.
    min_spp: int = least_spp("Guards against light that is found late.")

    def judge(self, evidence: Evidence) -> Verdict:
        """Return whether the target is surely reached; the value is the error."""
        self.foreseen_spp = None
        if evidence.quarters is None or not evidence.is_lit:
            dark = "no light has been found yet: the image is black"
            few = "there are no four slices yet to compare"
            return Verdict(False, None, {}, few if evidence.quarters is None else dark)
        error = self._error(evidence.quarters, evidence)
        reading = self._reading(error)
        growth = self._growth(reading.sure)
        if growth * evidence.spp < MOST_SPP:
            self.foreseen_spp = math.ceil(max(growth, 1) * evidence.spp)
        return Verdict(
            stop=growth <= 1 and evidence.spp >= self.min_spp,
            value=reading.value,
            numbers={
                **reading._asdict(),
                "freedom": error.freedom,
                "few_share": error.few_share,
                "non_finite_pixels": float(error.non_finite),
                "target": self.target,
            },
            reason=self._reason(evidence, error, reading, passed=growth <= 1),
        )

    def _error(self, quarters: Quarters, evidence: Evidence) -> SquaredError:  # noqa: ARG002
        """Return the squared error by this rule's weights: the relative one."""
        from plateau.metric.standard_error import relative, squared_error

        return squared_error(quarters, relative, lambda mean: (12 * mean) ** 2)

    def _reading(self, error: SquaredError) -> Reading:
        found = (error.mean, error.low, error.high, error.sure)
        return Reading(*(one**self.power for one in found))

    def _growth(self, error: float) -> float:
        """Return by what the samples must grow from this error to the target."""
        return float((error / self.target) ** (1 / self.power))

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


@dataclass(kw_only=True)
class Relmse(ErrorRule):
    """Stops by the relative mean squared error, the mean of (image - truth)²/(truth² + 0.01)."""

    name: ClassVar[str] = "relmse"
    title: ClassVar[str] = "A relative error, for references"
    help: ClassVar[str] = "Stops when the relative mean squared error is surely so small."
    order: ClassVar[int] = 10
    quantity: ClassVar[str] = "squared error"
    unit: ClassVar[str] = "relMSE"
    power: ClassVar[float] = 1

    target: float = _target(0.001, 1e-12, 1.0, "relMSE", "the relative mean squared error")


@dataclass(kw_only=True)
class Rmse(ErrorRule):
    """Stops by the root of the mean squared error of linear radiance."""

    name: ClassVar[str] = "rmse"
    title: ClassVar[str] = "An absolute error, for references"
    help: ClassVar[str] = "Stops when the root mean squared error of radiance is surely so small."
    order: ClassVar[int] = 11
    quantity: ClassVar[str] = "RMSE"
    unit: ClassVar[str] = "radiance"

    target: float = _target(0.01, 1e-9, 1e6, "radiance", "the root mean squared error of radiance")

    def _error(self, quarters: Quarters, evidence: Evidence) -> SquaredError:  # noqa: ARG002
        from plateau.metric.standard_error import plain, squared_error

        return squared_error(quarters, plain)


@dataclass(kw_only=True)
class Psnr(ErrorRule):
    """Stops by the peak signal-to-noise ratio of the image as it is shown, in sRGB values."""

    name: ClassVar[str] = "psnr"
    title: ClassVar[str] = "A PSNR, for references"
    help: ClassVar[str] = "Stops when the PSNR of the displayed image is surely so high."
    order: ClassVar[int] = 12
    quantity: ClassVar[str] = "PSNR"
    unit: ClassVar[str] = "dB"
    is_error: ClassVar[bool] = False

    target: float = _target(40.0, 5.0, 120.0, "dB", "the PSNR of the displayed image in dB")

    def _error(self, quarters: Quarters, evidence: Evidence) -> SquaredError:
        from plateau.metric.display import displayed, srgb_encoded
        from plateau.metric.standard_error import DISPLAY_ERROR, on_display, squared_error

        view = evidence.metric.view
        weight = on_display(lambda image: srgb_encoded(displayed(quarters.see(image), view)))
        return squared_error(quarters, weight, lambda _: DISPLAY_ERROR)

    def _reading(self, error: SquaredError) -> Reading:
        found = (error.mean, error.high, error.low, error.sure)
        return Reading(*(-10 * math.log10(max(one, 1e-20)) for one in found))

    def _growth(self, error: float) -> float:
        return float(10 ** ((self.target - error) / 10))


@dataclass(kw_only=True)
class Noise(ErrorRule):
    """Stops by the relative standard error of each pixel, at a share of the pixels.

    That of a pixel is the root of its relMSE over its tile of 8 by 8 pixels.
    """

    name: ClassVar[str] = "noise"
    title: ClassVar[str] = "A noise level, as of other renderers"
    help: ClassVar[str] = "Stops when most pixels surely have so small a relative standard error."
    order: ClassVar[int] = 13
    quantity: ClassVar[str] = "standard error"
    unit: ClassVar[str] = "of the light"

    target: float = _target(
        0.03, 1e-6, 1.0, "%", "the relative standard error of pixels", scale=0.01
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

    def _reading(self, error: SquaredError) -> Reading:
        return Reading(*map(math.sqrt, error.at_share(self.share)))
