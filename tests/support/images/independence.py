"""Judges whether slices of a scene are independent, by their images alone.

Needs slices of a scene whose pixels all have one expected value (``tests/reference/scenes/noise``):
then the noise of a slice is its difference from the mean of all pixels of all slices, and no
reference image is needed, whose own error would be in every slice alike.
"""

from dataclasses import dataclass
from pathlib import Path
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray
from PIL import Image


@dataclass(frozen=True)
class Verdict:
    """What the noise of n slices of N pixels says.

    Attributes
    ----------
    law : dict of int to float
        For m merged slices: the variance of their sum over the sum of their variances. 1 where
        the error falls as 1/sqrt(m); m where all slices are the same.
    law_bound : float
        How far from 1 it may lie.
    correlation : ndarray, shape (n, n)
        Pearson's r of the noise of each pair of slices.
    correlation_bound : float
        How far from 0 it may lie.
    """

    law: dict[int, float]
    law_bound: float
    correlation: NDArray[np.float64]
    correlation_bound: float

    @property
    def pairs(self) -> NDArray[np.float64]:
        return self.correlation[np.triu_indices(len(self.correlation), 1)]

    @property
    def law_holds(self) -> bool:
        return all(abs(ratio - 1) <= self.law_bound for ratio in self.law.values())

    @property
    def pairs_uncorrelated(self) -> bool:
        return bool(np.abs(self.pairs).max() <= self.correlation_bound)

    def __str__(self) -> str:
        law = ", ".join(f"{m}: {ratio:.4f}" for m, ratio in self.law.items())
        largest = np.abs(self.pairs).max()
        return (
            f"variance of m merged slices over independence: {law} (1 ± {self.law_bound:.4f}); "
            f"largest |r| of a pair: {largest:.4f} (0 ± {self.correlation_bound:.4f})"
        )


def judge(
    slices: NDArray[np.floating],
    *,
    false_failure_rate: float,
    law_allowance: float = 0.0,
    correlation_allowance: float = 0.0,
) -> Verdict:
    """Judge a stack of slices, shape (n, height, width), of one colour.

    Parameters
    ----------
    false_failure_rate : float
        The chance that independent slices are found guilty. Half goes to the law and half to the
        pairs, each divided by its number of tests (Bonferroni), two-sided, in the normal
        approximation: over N pixels, r of two independent slices has the standard deviation
        1/sqrt(N), and the ratio of the law at most sqrt(2/N).
    law_allowance, correlation_allowance : float
        What is allowed on top, for a generator that is known to be less than perfect.
    """
    noise = slices.astype(np.float64).reshape(len(slices), -1)
    noise -= noise.mean()
    products = noise @ noise.T
    variances = np.diagonal(products)
    if not (variances > 0).all():
        raise ValueError("slices without noise cannot be judged")
    merged = [2**k for k in range(1, len(slices).bit_length())]
    # The variance of the sum of the first m slices is the sum of the first m × m products.
    law = {m: float(products[:m, :m].sum() / variances[:m].sum()) for m in merged}
    pixels, pairs = noise.shape[1], len(slices) * (len(slices) - 1) // 2
    return Verdict(
        law=law,
        law_bound=_z(false_failure_rate / 2 / len(law)) * (2 / pixels) ** 0.5 + law_allowance,
        correlation=products / np.sqrt(np.outer(variances, variances)),
        correlation_bound=_z(false_failure_rate / 2 / pairs) / pixels**0.5 + correlation_allowance,
    )


def leave_behind(slices: NDArray[np.floating], verdict: Verdict, folder: Path) -> None:
    """Save what a person needs to see why: merged noise, the pairs' r, all numbers."""
    merged = slices.mean(axis=0)
    scale = 4 * merged.std() or 1.0
    _save(folder / "merged.png", 0.5 + (merged - merged.mean()) / (2 * scale))
    _save(folder / "correlation.png", 0.5 + verdict.correlation / (8 * verdict.correlation_bound))
    np.save(folder / "correlation.npy", verdict.correlation)
    (folder / "verdict.txt").write_text(f"{verdict}\n", encoding="utf-8")


def _z(p: float) -> float:
    """The two-sided quantile: |z| of a standard normal exceeds it with probability p."""
    return NormalDist().inv_cdf(1 - p / 2)


def _save(file: Path, grey: NDArray[np.floating]) -> None:
    Image.fromarray((np.clip(grey, 0, 1) * 255).astype(np.uint8)).save(file)
