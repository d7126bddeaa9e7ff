"""Which letters of a text people see: others may steer a terminal, or make two names look alike."""

import unicodedata
from typing import Final

#: Unicode's categories of control and format characters, surrogates and line ends.
_INVISIBLE: Final = frozenset({"Cc", "Cf", "Cs", "Zl", "Zp"})
#: Format characters that join letters or keep them apart, as Persian and emoji need.
_JOINERS: Final = "\u200c\u200d"


def is_visible(letter: str) -> bool:
    """Whether people see the letter or its effect: no control, format character or line end."""
    return letter in _JOINERS or unicodedata.category(letter) not in _INVISIBLE


def printable(text: str) -> str:
    """The text with its invisible letters escaped, except line ends.

    A scene may contain them: a terminal would obey them (colours, titles, moves of the cursor).
    """
    return "".join(
        letter if letter == "\n" or is_visible(letter) else ascii(letter)[1:-1] for letter in text
    )


def on_one_line(text: str) -> str:
    """The printable text, its lines one after the other."""
    return printable(" ".join(text.expandtabs(1).splitlines()))
