"""The thresholds of an observer study with confidence intervals: a logistic fit to single answers.

`plateau.study.psychometrics` fits the paper's curve to shares and weighs all points alike. Here
each answer counts once, so shares of 0 and 1 are no problem, and thresholds have intervals.

References
----------
D. Firth, Bias reduction of maximum likelihood estimates, Biometrika 80(1), 1993.
doi:10.1093/biomet/80.1.27
E. C. Fieller, Some problems in interval estimation, Journal of the Royal Statistical Society B
16(2), 1954. doi:10.1111/j.2517-6161.1954.tb00159.x
K.-Y. Liang and S. L. Zeger, Longitudinal data analysis using generalized linear models, Biometrika
73(1), 1986. doi:10.1093/biomet/73.1.13
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import NormalDist
from typing import TYPE_CHECKING, Final

import numpy as np

from plateau.study.psychometrics import Psychometric, logistic, logit

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

#: A fit to fewer answers would be meaningless.
FEWEST_ANSWERS: Final = 20

_MOST_STEPS: Final = 200
_CLOSE: Final = 1e-9


@dataclass(frozen=True, eq=False)
class AnswersFit(Psychometric):
    """A fit to single answers, with c = 1."""

    answers: int
    observers: int
    #: (2, 2) of a and b: as if all answers were independent, and by how observers differ.
    covariances: tuple[NDArray[np.float64], ...]

    @property
    def refusal(self) -> str | None:
        """Why nothing should be concluded from the fit, in words; None if something may be."""
        if self.answers < FEWEST_ANSWERS:
            return f"a fit needs {FEWEST_ANSWERS} answers or more, and there are {self.answers}"
        return super().refusal

    def interval(self, probability: float, confidence: float = 0.95) -> tuple[float, float] | None:
        """Return the spp between which the threshold lies with this confidence, lower first.

        None if the answers do not bound the threshold, because they hardly depend on spp.

        Notes
        -----
        Fieller's interval: all x for which chance may explain the distance of a x + b from the
        logit of the probability. Of the covariances, the one with the wider interval counts.
        """
        z2 = NormalDist().inv_cdf(0.5 + confidence / 2) ** 2
        offset = self.b - logit(probability)
        bounds = []
        for covariance in self.covariances:
            ((v_aa, v_ab), (_, v_bb)) = covariance.tolist()
            # (a x + offset)² ≤ z² (v_aa x² + 2 v_ab x + v_bb), as A x² + 2 B x + C ≤ 0.
            quadratic = self.a**2 - z2 * v_aa
            linear = self.a * offset - z2 * v_ab
            constant = offset**2 - z2 * v_bb
            if quadratic <= 0:
                return None
            # The threshold is always inside, so only rounding makes this negative.
            root = math.sqrt(max(0.0, linear**2 - quadratic * constant))
            bounds.append(((-linear - root) / quadratic, (-linear + root) / quadratic))
        return max(bounds, key=lambda bound: bound[1] - bound[0])


def fit_answers(spp: Sequence[float], seen: Sequence[bool], observers: Sequence[str]) -> AnswersFit:
    """Return the logistic curve that makes these answers likely, by Firth's penalised likelihood.

    Parameters
    ----------
    spp
        Samples per pixel of the test image of each answer, at least two different ones.
    seen
        Whether a difference was perceived, for each answer.
    observers
        The observer of each answer; the answers of one observer are not independent.

    Raises
    ------
    ValueError
        If the three are not of one length, or there are not two different spp.

    Notes
    -----
    The penalty (Jeffreys' prior) keeps the fit finite where all answers below some spp are yes and
    all above it no. With two observers or more there is a second covariance, from the differences
    between them (the sandwich estimator, clusters being observers, times n/(n-1)).

    Examples
    --------
    >>> spp = [100, 200, 300, 400] * 10
    >>> seen = [True, True, False, False] * 9 + [True, False, True, False]
    >>> fit = fit_answers(spp, seen, ["a"] * 20 + ["b"] * 20)
    >>> round(fit.threshold(0.5))
    250
    """
    x = np.asarray(spp, dtype=np.float64)
    y = np.asarray(seen, dtype=np.float64)
    if not x.ndim == 1 or not len(x) == len(y) == len(observers):
        raise ValueError("spp, seen and observers need one value for each answer")
    if not np.isfinite(x).all() or np.unique(x).size < 2:
        raise ValueError("a fit needs answers at two different spp or more")

    # In units that make the numbers about 1.
    centre, unit = float(x.mean()), float(x.std())
    design = np.stack([(x - centre) / unit, np.ones_like(x)], axis=-1)
    beta, information = _firth(design, y)
    inverse = np.linalg.inv(information)

    to_spp = np.array([[1 / unit, 0.0], [-centre / unit, 1.0]])
    covariances = [inverse]
    names, who = np.unique(np.asarray(observers), return_inverse=True)
    if names.size > 1:
        residuals = design * (y - logistic(design @ beta))[:, None]
        scores = np.zeros((names.size, 2))
        np.add.at(scores, who, residuals)
        between = scores.T @ scores * names.size / (names.size - 1)
        covariances.append(inverse @ between @ inverse)
    a, b = (to_spp @ beta).tolist()
    return AnswersFit(
        a=a,
        b=b,
        answers=x.size,
        observers=names.size,
        covariances=tuple(to_spp @ one @ to_spp.T for one in covariances),
    )


def _firth(
    design: NDArray[np.float64], y: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The coefficients where Firth's modified score is 0, and the information there."""
    beta = np.zeros(design.shape[1])
    for _ in range(_MOST_STEPS):
        p = logistic(design @ beta)
        weight = p * (1 - p)
        information = design.T @ (design * weight[:, None])
        leverage = weight * np.einsum("ij,jk,ik->i", design, np.linalg.inv(information), design)
        score = design.T @ (y - p + leverage * (0.5 - p))
        step = np.linalg.solve(information, score)
        # A longer step could overshoot.
        step /= max(1.0, float(np.abs(step).max()))
        beta += step
        if np.abs(step).max() < _CLOSE:
            break
    p = logistic(design @ beta)
    return beta, design.T @ (design * (p * (1 - p))[:, None])
