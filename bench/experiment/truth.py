"""When an image is converged, by an independent reference.

The reference R_N has noise of its own: D(R_N, I_m) sees as much noise as D(truth, I_n) would, where
1/n = 1/m + 1/N. So an image reaches a target against the reference later than against the converged
image; `converged_spp` corrects for that.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from plateau.metric.estimate import allowed_pixels

if TYPE_CHECKING:
    from bench.experiment.series import Measured

#: Shares of the pixels that may differ visibly.
TARGETS: Final = (0.01, 0.001, 0.0001)


def reference_spp(measured: Measured, target: float) -> int | None:
    """Return the spp from which on D(R_N, I_n) stays under a target; None if it never does."""
    allowed = allowed_pixels(target, measured.pixels**2)
    counts = dict(zip(measured.spp, measured.truth, strict=True))
    last_above = max((spp for spp, count in counts.items() if count > allowed), default=0)
    return next((spp for spp in measured.spp if spp > last_above), None)


def true_spp(measured: Measured, target: float) -> float | None:
    """Return `reference_spp` without the noise of the reference: that of D(truth, I_n)."""
    spp = reference_spp(measured, target)
    return None if spp is None else converged_spp(spp, measured.cap)


def converged_spp(spp: float, reference_spp: int) -> float:
    """Return at how many spp an image is as far from the truth as at `spp` from the reference.

    Examples
    --------
    >>> round(converged_spp(1000, 10_000))
    909
    """
    return 1 / (1 / spp + 1 / reference_spp)


def truth_at(measured: Measured, spp: float) -> float | None:
    """Return D(truth, I_n) at `spp`, in pixels; None if the series does not reach far enough."""
    if spp >= measured.cap:
        return None
    seen = 1 / (1 / spp - 1 / measured.cap)
    if not measured.spp[0] <= seen <= measured.spp[-1]:
        return None
    return float(np.interp(np.log(seen), np.log(measured.spp), measured.truth))
