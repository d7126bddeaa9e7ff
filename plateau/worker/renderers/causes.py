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

#: Lines of Mitsuba's log, and in them the file that it loads, and what it warns of.
_ENTRY: Final = r"^(?:\x1b\[[\d;]*m)*\d{4}-\d\d-\d\d \d\d:\d\d:\d\d "
_COLOURS: Final = re.compile(r"\x1b\[[\d;]*m")
_TIME: Final = re.compile(_ENTRY, re.MULTILINE)
_DETAIL: Final = re.compile(rf"{_ENTRY}(?:DEBUG|INFO) .*\n", re.MULTILINE)
_FILE: Final = re.compile(
    rf'{_ENTRY}DEBUG +\[\w+\] Loading (?!plugin)[^"\n]*"([^"\n]+)"', re.MULTILINE
)
_WARNING: Final = re.compile(rf"{_ENTRY}WARN +\[[^]\n]*\] ([^\x1b\n]+)", re.MULTILINE)

#: Where this machine keeps what it runs; a reason says nothing of it.
_PROGRAM: Final = (sysconfig.get_path("purelib"), str(Path(__file__).parents[3]))


def first_words(text: str) -> str:
    """Return the first lines of what an exception says."""
    first, rest = _whole_lines(text.strip().splitlines(), _FIRST)
    return "\n".join([*first, *([_LEFT_OUT] if rest else [])])


def first_and_last_words(text: str) -> str:
    """Return the first and the last lines of what a process printed before it died.

    Of a log of Mitsuba's about a scene that it loads, the last file is named in place of its lines.
    """
    words = without_details(_FRAMES.sub("", f"{text}\n"))
    first, rest = _whole_lines(words.strip().splitlines(), _FIRST)
    last, left_out = _whole_lines(rest[::-1], _LAST)
    file = file_at(text)
    at = [f"it was at the file {file}"] if file else []
    return "\n".join([*at, *first, *([_LEFT_OUT] if left_out else []), *last[::-1]])


def file_at(log: str) -> str | None:
    """Return the file that Mitsuba said last that it loads."""
    files = _FILE.findall(log)
    return files[-1] if files else None


def warnings_in(log: str) -> list[str]:
    """Return what Mitsuba warned of, each once, in its words."""
    return list(dict.fromkeys(one.strip() for one in _WARNING.findall(log)))


def without_details(log: str) -> str:
    """Return Mitsuba's log with its warnings and errors alone, the same at any time."""
    return _TIME.sub("", _DETAIL.sub("", _COLOURS.sub("", log)))


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
