"""Completion of words with colons in bash.

Bash splits ``scenes:box`` and ``http://…`` at the colons before it asks for completions, and
replaces only what follows the last colon. Typer does not expect that. So the words are joined
before Typer reads them, and its completions are cut at the last colon.
"""

import io
import os
from collections.abc import Callable
from contextlib import redirect_stdout
from typing import Final

#: Typer's script for bash passes the words, one per line, and the index of the current word.
_WORDS: Final = "COMP_WORDS"
_CURRENT: Final = "COMP_CWORD"


def completing_in_bash(variable: str) -> bool:
    """Whether bash asks this process for completions, by the variable of that name."""
    return os.environ.get(variable) == "complete_bash" and {_WORDS, _CURRENT} <= os.environ.keys()


def with_whole_words(complete: Callable[[], None]) -> None:
    """Call `complete` with joined words; prints what bash puts behind the last colon."""
    words, current = joined(os.environ[_WORDS].split("\n"), int(os.environ[_CURRENT]))
    os.environ[_WORDS], os.environ[_CURRENT] = "\n".join(words), str(current)
    kept = words[current].rpartition(":")[0] if current < len(words) else ""
    offered = io.StringIO()
    try:
        with redirect_stdout(offered):
            complete()
    finally:
        for line in offered.getvalue().splitlines():
            print(line.removeprefix(f"{kept}:") if kept else line)


def joined(words: list[str], current: int) -> tuple[list[str], int]:
    """The words, joined at their colons, and the index of the current one.

    >>> joined(["plateau", "render", "scenes", ":", "b"], 4)
    (['plateau', 'render', 'scenes:b'], 2)
    """
    found: list[str] = []
    place = 0
    open_end = False  # whether the next word continues this one
    for index, word in enumerate(words):
        colons = set(word) == {":"}
        if found and (colons or open_end):
            found[-1] += word
        else:
            found.append(word)
        open_end = colons
        if index <= current:
            place = len(found) - 1
    return found, place + max(0, current - len(words) + 1)
