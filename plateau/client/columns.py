"""A curve as columns."""

from collections.abc import Iterable
from datetime import timezone
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from plateau.farm.model.job import CurvePoint
from plateau.farm.wire.csv_text import FIGURES

_COUNTS: Final = ("spp", "visible_pixels", "non_finite_pixels")


def columns(points: list[CurvePoint]) -> dict[str, NDArray[Any]]:
    """The points as columns, named as in the CSV; `Client.curve_columns` documents the dtypes."""
    found: dict[str, NDArray[Any]] = {
        name: np.array([getattr(point, name) for point in points], dtype=np.int64)
        for name in _COUNTS
    }
    for name in FIGURES:
        found.setdefault(name, _floats(getattr(point, name) for point in points))
    times = [point.at.astimezone(timezone.utc).replace(tzinfo=None) for point in points]
    found["at"] = np.array(times, dtype="datetime64[ms]")
    for rule in sorted({name for point in points for name in point.rules}):
        said = [point.rules.get(rule) for point in points]
        found[f"{rule}_value"] = _floats(None if one is None else one.value for one in said)
        found[f"{rule}_stop"] = np.array([one is not None and one.stop for one in said], dtype=bool)
    return found


def _floats(values: Iterable[float | None]) -> NDArray[np.float64]:
    return np.array([np.nan if one is None else one for one in values], dtype=np.float64)
