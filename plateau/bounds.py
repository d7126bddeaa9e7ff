"""Numeric parameters with bounds, declared beside the default; the bounds are allowed values."""

from dataclasses import field, fields
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

_Number = TypeVar("_Number", int, float)

_BOUNDS = "bounds"


def bounded(default: _Number, least: _Number, most: _Number, **about: object) -> _Number:
    """Return the field of a dataclass that has this default and these bounds.

    If the default is an int, every value must be one. `about` becomes metadata of the field.
    """
    number: _Number = field(default=default, metadata={_BOUNDS: (least, most), **about})
    return number


def bounded_if_given(least: float, most: float) -> float | None:
    """Return the field of a dataclass that is None, or has these bounds."""
    number: float | None = field(default=None, metadata={_BOUNDS: (least, most)})
    return number


def require_bounds(parameters: "DataclassInstance") -> None:
    """Raise ValueError unless each bounded field of the dataclass lies between its bounds.

    A field whose default is None may be None too.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> @dataclass
    ... class Window:
    ...     points: int = bounded(5, 2, 1000)
    >>> require_bounds(Window(1000))
    >>> require_bounds(Window(1))
    Traceback (most recent call last):
    ValueError: points must be a whole number from 2 to 1,000, not 1
    """
    for one in fields(parameters):
        if _BOUNDS not in one.metadata:
            continue
        least, most = one.metadata[_BOUNDS]
        value = getattr(parameters, one.name)
        if value is None and one.default is None:
            continue
        is_whole = isinstance(one.default, int)
        fits = isinstance(value, int) and not isinstance(value, bool) if is_whole else True
        if not (fits and least <= value <= most):
            kind = "a whole number" if is_whole else "a number"
            raise ValueError(f"{one.name} must be {kind} from {least:,} to {most:,}, not {value!r}")
