"""A process that answers one question; here it is Python's own formatter of JSON."""

import threading

import pytest

from plateau.service.monitor.helper_process import HelperProcess, NoAnswer


@pytest.fixture
def helper() -> HelperProcess:
    return HelperProcess("json.tool")


def test_it_answers_one_question_after_the_other(helper: HelperProcess) -> None:
    for number in (1, 2):
        answer = helper.ask(lambda stream, n=number: stream.write(b"[%d]" % n), 60)
        assert answer.split() == [b"[", b"%d" % number, b"]"]


def test_a_process_that_fails_says_why(helper: HelperProcess) -> None:
    with pytest.raises(NoAnswer, match="Expecting value"):
        helper.ask(lambda stream: stream.write(b"[,"), 60)


def test_one_that_is_late_is_ended(helper: HelperProcess) -> None:
    with pytest.raises(NoAnswer, match="it took more than 0 s"):
        helper.ask(lambda _: threading.Event().wait(0.5), 0.1)


def test_a_question_that_cannot_be_written_ends_it(helper: HelperProcess) -> None:
    def write(_: object) -> None:
        raise LookupError("lost")

    with pytest.raises(LookupError, match="lost"):
        helper.ask(write, 60)


def test_once_closed_it_is_asked_no_more(helper: HelperProcess) -> None:
    helper.close()
    with pytest.raises(NoAnswer, match="the monitor stops"):
        helper.ask(lambda stream: stream.write(b"[]"), 60)
