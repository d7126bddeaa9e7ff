"""The psychometric function of section 3.2 of the paper, its thresholds, and the paper's fit.

References
----------
N. Takouachet, S. Delepoulle and C. Renaud, A perceptual stopping condition for global illumination
computations, SCCG 2007, equation 1 and tables 1 to 3.
F. A. Wichmann and N. J. Hill, The psychometric function: I. Fitting, sampling, and goodness of fit,
Perception & Psychophysics 63(8), 2001. doi:10.3758/BF03194544
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

#: The paper's c: slightly above 1, so that a probability of 1 has a logit.
CEILING: Final = 1.01


@dataclass(frozen=True, eq=False)
class Psychometric:
    """The probability to perceive a difference: p(x) = c e^(ax+b) / (1 + e^(ax+b))."""

    a: float  #: slope of the logit, per sample per pixel; negative if more samples help
    b: float  #: the logit at 0 spp

    @property
    def ceiling(self) -> float:
        """The c of the function."""
        return 1.0

    @property
    def refusal(self) -> str | None:
        """Why nothing should be concluded from the fit, in words; None if something may be."""
        if self.a < 0:
            return None
        return (
            "observers did not see differences less often at more samples per pixel; collect more "
            "answers, or show levels further apart"
        )

    def probability(self, spp: ArrayLike) -> NDArray[np.float64]:
        """Return the probability to perceive a difference at these spp, in (0, c), of their shape.

        Examples
        --------
        >>> fit = LogitFit(a=-0.002, b=4.0, c=1.01, r=-0.94)
        >>> fit.probability([0, 2000, 4000]).round(3).tolist()
        [0.992, 0.505, 0.018]
        """
        return self.ceiling * logistic(self.a * np.asarray(spp, dtype=np.float64) + self.b)

    def threshold(self, probability: float) -> float:
        """Return the spp at which a difference is perceived with this probability.

        It is x = (ln(q/(c-q)) - b)/a, which is negative if the fit never reaches the probability.

        Raises
        ------
        ValueError
            If the probability does not lie between 0 and c, or the fit is flat.

        Examples
        --------
        >>> round(LogitFit(a=-0.002, b=4.0, c=1.01, r=-0.94).threshold(0.5))
        2010
        """
        if self.a == 0:
            raise ValueError("a flat fit has no thresholds")
        return (logit(probability, self.ceiling) - self.b) / self.a


@dataclass(frozen=True, eq=False)
class LogitFit(Psychometric):
    """The paper's fit to shares."""

    c: float
    r: float  #: Pearson's correlation of x and the logit, in [-1, 1]

    @property
    def ceiling(self) -> float:
        """The fit's c."""
        return self.c


def fit_logit(spp: Sequence[float], probabilities: Sequence[float]) -> LogitFit:
    """Return the least-squares line through the logits ln(p/(c-p)) over spp, as the paper fits it.

    Parameters
    ----------
    spp
        Samples per pixel of the images shown, at least two different ones.
    probabilities
        To perceive a difference from the reference, above 0 and below c = 1.01.

    Raises
    ------
    ValueError
        If a value is out of its domain, or there are not two different spp.

    Notes
    -----
    A fit to logits weighs all points alike, however close to 0 or c, as the paper does. The
    maximum-likelihood fit to single answers in `plateau.study.answers` weighs by information.

    Examples
    --------
    >>> spp = [100, 500, 900, 1300, 1700, 2100, 2500]
    >>> fit = fit_logit(spp, [1, 0.96, 0.88, 0.67, 0.48, 0.52, 0.44])
    >>> f"{fit.a:.5f} {fit.b:.3f} {fit.r:.3f}"
    '-0.00200 4.007 -0.940'
    """
    x = np.asarray(spp, dtype=np.float64)
    if x.ndim != 1 or x.size != len(probabilities):
        raise ValueError(f"{x.size} spp and {len(probabilities)} probabilities do not go together")
    if not np.isfinite(x).all() or np.unique(x).size < 2:
        raise ValueError("a fit needs probabilities at two different spp or more")
    logits = np.array([logit(p, CEILING) for p in probabilities])

    dx, dy = x - x.mean(), logits - logits.mean()
    a = float(dx @ dy / (dx @ dx))
    spread = math.sqrt(float((dx @ dx) * (dy @ dy)))
    return LogitFit(
        a=a,
        b=float(logits.mean() - a * x.mean()),
        c=CEILING,
        r=float(dx @ dy) / spread if spread > 0 else 0.0,
    )


def logistic(logits: NDArray[np.float64]) -> NDArray[np.float64]:
    """e^x / (1 + e^x), without overflow on either side."""
    share: NDArray[np.float64] = 0.5 * (1 + np.tanh(logits / 2))
    return share


def logit(probability: float, ceiling: float = 1.0) -> float:
    """ln(p/(c-p)), or `ValueError` outside of (0, c)."""
    if not 0 < probability < ceiling:
        raise ValueError(
            f"the probability {probability:g} cannot be fitted; it must be above 0 and below "
            f"c = {ceiling:g}"
        )
    return math.log(probability / (ceiling - probability))
