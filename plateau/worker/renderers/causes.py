"""What went wrong, as a job's reason has it: what was said first, in whole lines."""

import re
import sysconfig
from collections.abc import Iterable
from pathlib import Path
from typing import Final

#: Characters of the first lines, and of the last ones.
_FIRST: Final = 600
_LAST: Final = 300
_LEFT_OUT: Final = "… (the slice's log has the rest)"

#: The frames of a traceback; what follows them is the exception.
_FRAMES: Final = re.compile(r"^Traceback \(most recent call last\):\n(?:[ \t].*\n)*", re.MULTILINE)

#: Where this machine keeps what it runs; a reason says nothing of it.
_PROGRAM: Final = (sysconfig.get_path("purelib"), str(Path(__file__).parents[3]))


def first_words(text: str) -> str:
    """Return the first lines of what an exception says."""
    first, rest = _whole_lines(text.strip().splitlines(), _FIRST)
    return "\n".join([*first, *([_LEFT_OUT] if rest else [])])


def first_and_last_words(text: str) -> str:
    """Return the first and the last lines of what a process printed before it died."""
    first, rest = _whole_lines(_FRAMES.sub("", f"{text}\n").strip().splitlines(), _FIRST)
    last, left_out = _whole_lines(rest[::-1], _LAST)
    return "\n".join([*first, *([_LEFT_OUT] if left_out else []), *last[::-1]])


def without_folders(text: str, folders: Iterable[Path]) -> str:
    """Return a text without these folders of this machine, and without those of its programs."""
    ways = {str(way) for folder in folders for way in (folder, folder.resolve())}
    for folder in sorted({*ways, *_PROGRAM}, key=len, reverse=True):
        text = text.replace(f"{folder}/", "")
    return text


def _whole_lines(lines: list[str], most: int) -> tuple[list[str], list[str]]:
    """Return the lines that fit into so many characters, of which one is always, and the rest."""
    count, taken = 0, 0
    while count < len(lines) and (count == 0 or taken + len(lines[count]) < most):
        taken += len(lines[count]) + 1
        count += 1
    return [_cut(line, most) for line in lines[:count]], lines[count:]


def _cut(line: str, most: int) -> str:
    return line if len(line) <= most else f"{line[:most].rsplit(' ', 1)[0]} …"
