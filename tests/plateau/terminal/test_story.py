"""A job's story and its log, as people read them."""

from datetime import datetime, timedelta, timezone

from plateau.farm.model.job import Event, LogEntry
from plateau.terminal.story import story

START = datetime(2026, 11, 21, 8, 0, tzinfo=timezone.utc)


def at(second: float) -> datetime:
    return START + timedelta(seconds=second)


def event(second: float, kind: str, **data: object) -> Event:
    return Event(id=f"{second}-0", type=kind, data=data, at=at(second))


def entry(second: float, what: str, **more: object) -> LogEntry:
    return LogEntry.model_validate(
        {"at": at(second), "slice": 3, "worker": "w", "what": what, **more}
    )


CREATED = event(0, "state", to="queued", reason="created")
STARTED = event(1, "state", to="rendering", reason="rendering with llvm_ad_rgb")
FAILED = event(60, "state", to="failed", reason="nobody survived it")


def trouble(second: float, cause: str = "SIGSEGV") -> Event:
    return event(second, "trouble", index=3, worker="w", cause=cause)


def test_troubles_stand_where_they_happened() -> None:
    events = [CREATED, STARTED, event(2, "slice", index=0, worker="w"), trouble(3), FAILED]
    log = [entry(3, "died", cause="SIGSEGV"), entry(2, "unfit", cause="no LLVM")]
    assert story("a1", events, log) == [
        "2026-11-21 08:00:00 UTC  queued: created",
        "2026-11-21 08:00:01 UTC  rendering: rendering with llvm_ad_rgb",
        "2026-11-21 08:00:02 UTC    slice 3, worker w: out of service: no LLVM",
        "2026-11-21 08:00:03 UTC    slice 3, worker w: SIGSEGV",
        "2026-11-21 08:01:00 UTC  failed: nobody survived it",
    ]


def test_what_ended_the_job_stands_before_its_end() -> None:
    assert [line[25:] for line in story("a1", [FAILED, trouble(60)], [])] == [
        "  slice 3, worker w: SIGSEGV",
        "failed: nobody survived it",
    ]


def test_a_long_story_is_told_shortly() -> None:
    events = [CREATED, *(trouble(2 + i, f"cause {i}") for i in range(50)), FAILED]
    told = story("a1", events, [])
    assert len(told) == 2 + 12 + 1
    assert told[5].endswith("  … and 38 more troubles: plateau log a1")
    assert told[4].endswith("cause 3")
    assert told[6].endswith("cause 42")
    assert told[-1].endswith("failed: nobody survived it")


def test_a_cause_of_many_lines_is_a_line_and_cannot_command_the_terminal() -> None:
    (line,) = story("a1", [trouble(1, "first\n\n  second \x1b[2J" + "x" * 500)], [])
    assert "first | second \\x1b[2J" in line
    assert line.endswith("x…")
    assert len(line) < 270
