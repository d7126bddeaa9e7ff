"""Lists of parameters from ranges and lists of values.

>>> each(["frame=1..3", "light=dim,bright"])[:3]
[{'frame': '1', 'light': 'dim'}, {'frame': '1', 'light': 'bright'}, {'frame': '2', 'light': 'dim'}]
"""

import math
import re
from collections.abc import Sequence
from itertools import product
from typing import Final

from plateau.errors import CommandFailed
from plateau.farm.model.spec import MAX_ENTRIES, parameter_strings

Values = dict[str, str | int | float | bool]

_RANGE: Final = re.compile(r"(-?[0-9]{1,9})\.\.(-?[0-9]{1,9})(?:(?:\.\.|:)([1-9][0-9]{0,8}))?")
#: What is meant as a range, whatever follows.
_LIKE_A_RANGE: Final = re.compile(r"[-+]?[0-9]+\.\.[^,]*")
#: How other programs write a range: 1-10, 1-10x2, 1-10:2, 1:10, 1…10.
_OTHER_RANGE: Final = re.compile(r"([0-9]+) *(?:[-–:…]|\.{3}|to) *([0-9]+)(?:[x:%]([0-9]+))?")


def each(definitions: Sequence[str], most: int = MAX_ENTRIES) -> list[Values]:
    """Every combination of the defined values; the last parameter varies fastest.

    Parameters
    ----------
    definitions
        ``NAME=FIRST..LAST`` or ``NAME=FIRST..LAST:STEP`` (also ``FIRST..LAST..STEP``) for whole
        numbers, LAST included; ``NAME=VALUE,VALUE,…`` for other values, and for several ranges.
        Zeros ahead of FIRST are kept.
    most
        How many combinations there may be.

    Raises
    ------
    CommandFailed
        A definition is malformed, a name occurs twice, or there are too many combinations.
    """
    names, values = [], []
    for definition in definitions:
        name, separator, text = definition.partition("=")
        if not (separator and name and text):
            raise CommandFailed(f"--each takes NAME=FIRST..LAST or NAME=A,B,…, not {definition!r}")
        names.append(name)
        values.append(_values(text, most))
    if len(set(names)) < len(names):
        raise CommandFailed("--each names one parameter twice")
    _check_count(math.prod(map(len, values)), most)
    return _without_twins([dict(zip(names, one, strict=True)) for one in product(*values)])


def _values(text: str, most: int) -> list[str]:
    """The values of a list, whose parts may be ranges."""
    values: list[str] = []
    for part in text.split(","):
        one = _RANGE.fullmatch(part)
        if one is not None:
            values += _range(one, most)
        elif _LIKE_A_RANGE.fullmatch(part):
            raise CommandFailed(
                f"--each takes a range as 0..99 or 0..99:2, of whole numbers of nine digits at "
                f"most and a positive step, not {part!r}"
            )
        elif (other := _OTHER_RANGE.fullmatch(part)) is not None:
            step = f":{other[3]}" if other[3] else ""
            raise CommandFailed(
                f"--each takes a range as 0..99 or 0..99:2, not {part!r}: did you mean "
                f"{other[1]}..{other[2]}{step}?"
            )
        elif not part:
            raise CommandFailed(f"--each: {text!r} has a comma with no value before or after it")
        else:
            values.append(part)
        _check_count(len(values), most)
    return values


def _range(match: re.Match[str], most: int) -> list[str]:
    """The numbers of a range, with zeros ahead where its first one has them."""
    first, last, step = int(match[1]), int(match[2]), int(match[3] or 1)
    numbers = range(first, last + 1, step) if first <= last else range(first, last - 1, -step)
    _check_count(len(numbers), most)
    digits = match[1].lstrip("-")
    width = len(match[1]) if digits.startswith("0") and len(digits) > 1 else 0
    return [f"{number:0{width}d}" for number in numbers]


def _without_twins(entries: list[Values]) -> list[Values]:
    """Refuse entries that are equal: their jobs would render one frame several times."""
    places: dict[tuple[tuple[str, str], ...], int] = {}
    for number, entry in enumerate(entries, start=1):
        first = places.setdefault(tuple(sorted(parameter_strings(entry).items())), number)
        if first != number:
            what = ", ".join(f"{name}={value}" for name, value in entry.items())
            raise CommandFailed(f"the jobs {first} and {number} would be the same: {what}")
    return entries


def _check_count(count: int, most: int) -> None:
    if count > most:
        raise CommandFailed(
            f"that makes {count:,} jobs, and {most:,} can be made at once: submit them in parts, "
            "all with the same --batch"
        )
