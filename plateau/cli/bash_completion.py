"""Words with colons, for completion in bash.

Bash takes ``scenes:box`` and ``http://…`` apart at the colons before it asks for completions, and
puts what it gets behind the last colon. Typer does not know of that, so the words are put together
again before it reads them, and what it offers is shortened to what bash wants.
"""

import io
import os
from collections.abc import Callable
from contextlib import redirect_stdout
from typing import Final

#: Typer's script for bash hands the words over in these, a line for each word.
_WORDS: Final = "COMP_WORDS"
_CURRENT: Final = "COMP_CWORD"


def completing_in_bash(variable: str) -> bool:
    """Whether this process is asked for completions by bash, by the variable of that name."""
    return os.environ.get(variable) == "complete_bash" and {_WORDS, _CURRENT} <= os.environ.keys()


def with_whole_words(complete: Callable[[], None]) -> None:
    """Complete with words that have their colons; prints what bash puts behind the last one."""
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
    """The words, those that belong together in one, and which of them is the current one.

    >>> joined(["plateau", "render", "scenes", ":", "b"], 4)
    (['plateau', 'render', 'scenes:b'], 2)
    """
    found: list[str] = []
    place = 0
    open_end = False  # whether the word before ends with a colon that wants more
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
