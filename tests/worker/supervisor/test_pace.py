"""A worker that stops knows whether the slice in hand ends soon."""

import time

import pytest

from plateau.worker.supervisor.pace import Pace


def test_of_the_first_slice_of_a_job_nothing_is_known() -> None:
    pace = Pace()
    assert not pace.ends_within(600)
    pace.began("job")
    assert not pace.ends_within(600)
    pace.took("job", 1.0)
    pace.began("other")
    assert not pace.ends_within(600)


def test_the_next_one_is_taken_to_last_as_long() -> None:
    pace = Pace()
    pace.began("job")
    pace.took("job", 30.0)
    pace.began("job")
    assert pace.ends_within(31.0)
    assert not pace.ends_within(25.0)


def test_one_that_takes_far_longer_is_not_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    pace = Pace()
    pace.took("job", 0.0)
    pace.began("job")
    assert pace.ends_within(2.0)
    later = time.monotonic() + 1.1
    monkeypatch.setattr(time, "monotonic", lambda: later)
    assert not pace.ends_within(2.0)
