"""What a log line is about, and what it may not do to a terminal."""

from collections.abc import Iterator

import pytest
from structlog.contextvars import clear_contextvars, get_contextvars

from farm.log import concern, concerning, printable


@pytest.fixture(autouse=True)
def _nothing_left() -> Iterator[None]:
    clear_contextvars()
    yield
    clear_contextvars()


def test_lines_are_about_the_innermost_job_and_slice() -> None:
    with concerning("outer"):
        with concerning("outer", 3):
            assert get_contextvars() == {"job": "outer", "slice": 3}
        assert get_contextvars() == {"job": "outer"}
    assert get_contextvars() == {}


def test_an_exception_says_what_it_was_about_to_whoever_catches_it() -> None:
    with concerning("job"):
        with pytest.raises(RuntimeError), concerning("job", 3):
            raise RuntimeError
        assert get_contextvars() == {"job": "job", "slice": 3}
    # But not beyond the context around it
    assert get_contextvars() == {}


def test_a_thread_may_be_about_one_thing_after_another() -> None:
    concern("one", 3)
    concern("other", 4)
    assert get_contextvars() == {"job": "other", "slice": 4}
    concern("third")
    assert get_contextvars() == {"job": "third"}


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
