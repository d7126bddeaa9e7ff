"""Mitsuba's `$parameters`: a job's values, a scene's defaults, and their substitution.

Mirrors `substitute_parameters` of Mitsuba's src/core/parser.cpp, order and oddities included:
the check must see what Mitsuba will see.
"""

import difflib
import re
from collections.abc import Mapping

from plateau.farm.bundle.limits import BundleError, BundleLimits, shown, shown_name
from plateau.farm.bundle.tree import folded
from plateau.farm.bundle.xml import BudgetSpent, XmlBudget

#: Letters of any script, whose accents may be characters of their own.
_LETTER = r"[\w\u0300-\u036f]"
_NAME = re.compile(rf"[^\W\d]{_LETTER}*")
_UNRESOLVED = re.compile(rf"(?<!\\)\$({_LETTER}*)")
_MAX_VALUE_CHARACTERS = 4096
#: Names of parameters in an error message, and characters of each.
_MAX_NAMES = 20
_MAX_NAME = 40
#: Searching this much text takes as long as the look at a short one.
_CHARACTERS_PER_LOOK = 64


class Parameters:
    """The parameters of one scene while it is read from start to end.

    `given` has the job's values, by name without the `$`; `BundleError` where a name or a value is
    malformed, or they are too many.
    """

    def __init__(self, given: Mapping[str, str], limits: BundleLimits, budget: XmlBudget) -> None:
        if len(given) > limits.max_parameters:
            raise BundleError(
                "bad-parameter",
                f"the job has {len(given)} parameters; {limits.max_parameters} are allowed",
            )
        for name, value in given.items():
            _check_given(name, value)
        self._given = given
        self._limits = limits
        self._budget = budget
        #: by `$name`, a longer one first, so that $width is never taken for $w and "idth"
        self._values = sorted(
            ((f"${name}", value) for name, value in given.items()), key=lambda item: -len(item[0])
        )
        self._used: set[str] = set()
        #: the scene's own defaults, whether overruled or not
        self.defaults: dict[str, str] = {}

    @property
    def revision(self) -> int:
        """Changes with the values in effect: at one revision, a text is always replaced alike."""
        return len(self.defaults)

    def add_default(self, name: str, value: str, file: str, line: int) -> None:
        """Take a `<default>`: the first of its name counts, unless the job gives a value."""
        self.defaults.setdefault(name, value)
        if len(self.defaults) > self._limits.max_parameters:
            raise BundleError(
                "xml-too-large",
                f"the scene has more than {self._limits.max_parameters} parameters",
                file=file,
                line=line,
            )
        key = f"${name}"
        if any(key == known for known, _ in self._values):
            return
        position = next(
            (i for i, (known, _) in enumerate(self._values) if len(key) > len(known)),
            len(self._values),
        )
        self._values.insert(position, (key, value))

    def substitute(self, text: str, file: str, line: int) -> str:
        r"""Return an attribute's value with every `$name` replaced, and `\$` become `$`."""
        if "$" not in text:
            return text
        self._check_length(len(text), file, line)
        characters = len(text)
        for key, value in self._values:
            if key in text:
                text = self._replace(text, key, value, file, line)
                characters = max(characters, len(text))
        looks = len(self._values) * (1 + characters // _CHARACTERS_PER_LOOK)
        self._budget.spend("substitutions", looks, file, line)
        unresolved = _UNRESOLVED.search(text)
        if unresolved:
            raise BundleError(
                "undefined-parameter",
                f"${unresolved[1][:_MAX_NAME]} has no value; give it in the job's parameters, or "
                f"add a <default> ahead of this line ({self._known()})",
                file=file,
                line=line,
            )
        return text.replace("\\$", "$")

    def check_all_used(self) -> None:
        """Refuse a parameter that the scene never uses, as Mitsuba does."""
        for name in self._given:
            if name not in self._used:
                same = [one for one in self._names() if folded(one) == folded(name)]
                close = same or difflib.get_close_matches(name, self._names(), n=1)
                hint = f"; did you mean {shown(close[0])}?" if close and close[0] != name else ""
                if hint and close == same and not close[0].isascii():
                    hint = f"{hint[:-1]}, that is {close[0]!a}, and not {name!a}?"
                raise BundleError(
                    "unknown-parameter",
                    f"the scene does not use a parameter {shown(name)}{hint} ({self._known()})",
                )

    def _check_length(self, characters: int, file: str, line: int) -> None:
        if characters > self._limits.max_substituted_characters:
            raise BudgetSpent(
                f"with its parameters put in, it may have more than "
                f"{self._limits.max_substituted_characters} characters",
                file=file,
                line=line,
            )

    def _replace(self, text: str, key: str, value: str, file: str, line: int) -> str:
        """Return the text with one parameter replaced wherever no backslash precedes it."""
        first, *rest = text.split(key)
        # Checked ahead: defaults made of defaults can double without end.
        self._check_length(len(text) + len(rest) * len(value), file, line)
        pieces, last = [first], first[-1:]
        for piece in rest:
            if last == "\\":
                put = key
            else:
                put = value
                self._used.add(key[1:])
            pieces += (put, piece)
            last = (put + piece)[-1:] or last
        return "".join(pieces)

    def _names(self) -> list[str]:
        return sorted(self.defaults.keys() | self._used)

    def _known(self) -> str:
        names = [shown_name(name[:_MAX_NAME]) for name in self._names()]
        more = ", …" if len(names) > _MAX_NAMES else ""
        known = ", ".join(names[:_MAX_NAMES]) + more
        return f"the scene's parameters: {known}" if names else "the scene has none"


def _check_given(name: str, value: str) -> None:
    if not _NAME.fullmatch(name):
        raise BundleError(
            "bad-parameter",
            f"{shown(name)} is no parameter's name: letters, digits and _ are allowed",
        )
    if len(value) > _MAX_VALUE_CHARACTERS or not value.isprintable():
        raise BundleError(
            "bad-parameter",
            f"the value of {shown(name)} has control characters or more than "
            f"{_MAX_VALUE_CHARACTERS} characters",
        )
    # Mitsuba would look for parameters in it again, in an undefined order.
    if "$" in value or "\\" in value:
        raise BundleError("bad-parameter", f"the value of {shown(name)} has a $ or a backslash")
