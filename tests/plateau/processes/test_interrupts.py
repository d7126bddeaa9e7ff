"""Ctrl-C and its kin, counted."""

import os
import signal

import pytest

from plateau.processes.interrupts import Interrupts


def test_the_first_asks_and_the_second_insists() -> None:
    before = signal.getsignal(signal.SIGTERM)
    with Interrupts() as interrupts:
        assert not interrupts.asked.is_set()
        os.kill(os.getpid(), signal.SIGTERM)
        assert interrupts.asked.wait(60)  # another thread may have been told first
        assert not interrupts.insisted.is_set()
        os.kill(os.getpid(), signal.SIGTERM)  # SIGINT is ignored where tests run in the background
        assert interrupts.insisted.wait(60)
    assert interrupts.exit_code == 143
    assert signal.getsignal(signal.SIGTERM) is before


def test_what_nohup_ignores_stays_ignored() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with Interrupts() as interrupts:
            os.kill(os.getpid(), signal.SIGHUP)
            assert not interrupts.asked.is_set()
    finally:
        signal.signal(signal.SIGHUP, before)


def test_where_it_is_said_one_ends_the_call_at_once() -> None:
    with Interrupts() as interrupts:
        with interrupts.ended_by(interrupts.insisted):
            signal.raise_signal(signal.SIGTERM)
        with pytest.raises(KeyboardInterrupt), interrupts.ended_by(interrupts.insisted):
            signal.raise_signal(signal.SIGTERM)
        with pytest.raises(KeyboardInterrupt), interrupts.ended_by(interrupts.asked):
            pytest.fail("it was asked before this began")
