"""Mitsuba's `$parameters`: what a job gives, what a scene defaults to, and how they replace text.

Mirrors `substitute_parameters` of Mitsuba's src/core/parser.cpp, order and oddities included:
what is checked has to be what Mitsuba will see.
"""

import difflib
import re
from collections.abc import Mapping

from farm.bundle_rules import BundleError

_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_UNRESOLVED = re.compile(r"(?<!\\)\$([A-Za-z0-9_]*)")
_MAX_VALUE_CHARACTERS = 4096


class Parameters:
    """The parameters of one scene while it is read from start to end.

    Parameters
    ----------
    given : mapping of str to str
        The job's values, by name without the `$`.

    Raises
    ------
    BundleError
        Where a name or a value is malformed.
    """

    def __init__(self, given: Mapping[str, str]) -> None:
        for name, value in given.items():
            _check_given(name, value)
        self._given = given
        # A longer name first, so that $width is never taken for $w and "idth".
        self._values = sorted(given.items(), key=lambda item: -len(item[0]))
        self._used: set[str] = set()
        #: the scene's own defaults, whether overruled or not
        self.defaults: dict[str, str] = {}

    def add_default(self, name: str, value: str) -> None:
        """Take a `<default>`: the first of its name counts, unless the job gives a value."""
        self.defaults.setdefault(name, value)
        if any(name == known for known, _ in self._values):
            return
        position = next(
            (i for i, (known, _) in enumerate(self._values) if len(name) > len(known)),
            len(self._values),
        )
        self._values.insert(position, (name, value))

    def substitute(self, text: str, file: str, line: int) -> str:
        r"""Return an attribute's value with every `$name` replaced, and `\$` become `$`."""
        if "$" not in text:
            return text
        for name, value in self._values:
            text = self._replace(text, name, value)
        unresolved = _UNRESOLVED.search(text)
        if unresolved:
            raise BundleError(
                "undefined-parameter",
                f"${unresolved[1]} has no value; give it in the job's parameters, or add a "
                f"<default> ahead of this line ({self._known()})",
                file=file,
                line=line,
            )
        return text.replace("\\$", "$")

    def check_all_used(self) -> None:
        """Refuse a parameter that the scene never uses, as Mitsuba does.

        Raises
        ------
        BundleError
            Names the parameter, and those that the scene knows.
        """
        for name in self._given:
            if name not in self._used:
                close = difflib.get_close_matches(name, self._names(), n=1)
                hint = f"; did you mean {close[0]!r}?" if close and close[0] != name else ""
                raise BundleError(
                    "unknown-parameter",
                    f"the scene does not use a parameter {name!r}{hint} ({self._known()})",
                )

    def _replace(self, text: str, name: str, value: str) -> str:
        key = "$" + name
        position = text.find(key)
        while position >= 0:
            if position and text[position - 1] == "\\":
                position = text.find(key, position + len(key))
                continue
            text = text[:position] + value + text[position + len(key) :]
            self._used.add(name)
            position = text.find(key, position + len(value))
        return text

    def _names(self) -> list[str]:
        return sorted(self.defaults.keys() | self._used)

    def _known(self) -> str:
        names = self._names()
        return f"the scene's parameters: {', '.join(names)}" if names else "the scene has none"


def _check_given(name: str, value: str) -> None:
    if not _NAME.fullmatch(name):
        raise BundleError(
            "bad-parameter",
            f"{name!a} is no parameter's name: letters, digits and _ are allowed",
        )
    if len(value) > _MAX_VALUE_CHARACTERS or not value.isprintable():
        raise BundleError(
            "bad-parameter",
            f"the value of {name!r} has control characters or more than "
            f"{_MAX_VALUE_CHARACTERS} characters",
        )
    # Mitsuba would look for parameters in it again, in an order that is not defined.
    if "$" in value or "\\" in value:
        raise BundleError("bad-parameter", f"the value of {name!r} has a $ or a backslash")
