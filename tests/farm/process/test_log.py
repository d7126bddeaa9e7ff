"""What a log line is about, and what it may not do to a terminal."""

import io
import json
import logging
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from plateau.farm.process.log import (
    LogFormat,
    concern,
    concerning,
    concerns,
    identify,
    printable,
    rotate,
    set_up,
)


def test_lines_are_about_the_innermost_job_and_slice() -> None:
    before = concerns()
    with concerning("outer"):
        with concerning("outer", 3):
            assert concerns() == {"job": "outer", "slice": 3}
        assert concerns() == {"job": "outer"}
    assert concerns() == before


def test_an_exception_says_what_it_was_about_to_whoever_catches_it() -> None:
    before = concerns()
    with concerning("job"):
        with pytest.raises(RuntimeError), concerning("job", 3):
            raise RuntimeError
        assert concerns() == {"job": "job", "slice": 3}
    # But not beyond the context around it
    assert concerns() == before


def test_a_thread_may_be_about_one_thing_after_another() -> None:
    with concerning("before"):
        concern("one", 3)
        concern("other", 4)
        assert concerns() == {"job": "other", "slice": 4}
        concern("third")
        assert concerns() == {"job": "third"}


@contextmanager
def _written(log_format: LogFormat, monkeypatch: pytest.MonkeyPatch) -> Iterator[io.StringIO]:
    """What a process of its own would write to standard error; logging is as before afterwards."""
    root = logging.getLogger()
    handlers, level = root.handlers[:], root.level
    root.handlers = []
    written = io.StringIO()
    monkeypatch.setattr(sys, "stderr", written)
    try:
        set_up("worker", log_format)
        identify(worker="w 1")
        yield written
    finally:
        logging.captureWarnings(False)
        root.handlers, root.level = handlers, level


def _fail() -> None:
    try:
        raise ValueError("bad \x1b[2J scene")
    except ValueError:
        logging.getLogger("any").exception("it failed:\nso %s", "it is")


def test_programs_read_an_object_from_every_line(monkeypatch: pytest.MonkeyPatch) -> None:
    with _written("json", monkeypatch) as written, concerning("0123456789ab", 3):
        logging.getLogger("any").info("%d of %s", 1, "été")
        _fail()
    first, second = map(json.loads, written.getvalue().splitlines())
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{6}Z", first.pop("time"))
    about = {"role": "worker", "worker": "w 1", "job": "0123456789ab", "slice": 3}
    assert first == {"level": "info", "message": "1 of été", **about}
    assert list(second)[:3] == ["time", "level", "message"]
    assert second["message"] == "it failed:\nso it is"
    assert second["exception"].startswith("Traceback")
    assert second["exception"].endswith("ValueError: bad \x1b[2J scene")


def test_people_read_a_line_and_the_exception_below_it(monkeypatch: pytest.MonkeyPatch) -> None:
    with _written("text", monkeypatch) as written, concerning("job='other' slice=4", 3):
        _fail()
    line, below, *_, last = written.getvalue().splitlines()
    assert line.partition(" ")[2] == (
        "[error] it failed: | so it is role=worker worker='w 1' job=\"job='other' slice=4\" slice=3"
    )
    assert below.startswith("Traceback")
    assert last == r"ValueError: bad \x1b[2J scene"


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("two\nlines, é and 猫", "two\nlines, é and 猫"),
        ("\x1b[2Jgone\x07", "\\x1b[2Jgone\\x07"),
        ("a\rb\x85c\u2028d\u202ee", "a\\rb\\x85c\\u2028d\\u202ee"),
        ("\udc80", "\\udc80"),
    ],
)
def test_a_terminal_is_shown_what_it_would_obey(text: str, shown: str) -> None:
    assert printable(text) == shown


def test_a_log_is_begun_anew_while_it_is_written_to(tmp_path: Path) -> None:
    log = tmp_path / "some.log"
    with log.open("ab", buffering=0) as writer:
        writer.write(b"old " * 100)
        assert not rotate(log, most_bytes=400)
        writer.write(b"!")
        assert rotate(log, most_bytes=400)
        writer.write(b"new")
    assert log.read_bytes() == b"new"
    assert (tmp_path / "some.log.1").read_bytes() == b"old " * 100 + b"!"
    assert not rotate(tmp_path / "none.log")
