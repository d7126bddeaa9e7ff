"""What is shown of a job while it runs."""

import io
import re
from datetime import datetime, timedelta, timezone

import pytest
import redis
from rich.console import Console

from plateau.farm.ledger.jobs import Jobs
from plateau.farm.wire.views import job_view
from plateau.terminal.progress import LiveProgress, PlainProgress, progress_on
from tests.support.farms.staged_job import StagedJob


@pytest.fixture(autouse=True)
def terminal_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """A terminal that can, wherever the tests run."""
    monkeypatch.setenv("TERM", "xterm")


def shown(
    client: redis.Redis,
    *,
    terminal: bool,
    curve: bool = True,
    size: dict[str, int] | None = None,
    **spec: object,
) -> str:
    """All that a watcher sees of a job with three points."""
    staged = StagedJob(client, **spec)
    text = io.StringIO()
    size = size or {"width": 120, "height": 30}
    console = Console(file=text, force_terminal=terminal, legacy_windows=False, **size)
    progress = progress_on(console, curve=curve)
    assert isinstance(progress, LiveProgress if terminal else PlainProgress)
    jobs = Jobs(client)
    with progress:
        progress.job(job_view(jobs.get(staged.id)))
        staged.commit(12)
        for spp, visible, slope in ((100, 0, None), (200, 20, None), (300, 25, 0.125)):
            staged.point(spp, visible, slope)
        progress.job(job_view(jobs.get(staged.id)))
        start = datetime(2026, 1, 1, tzinfo=timezone.utc)
        for number, event in enumerate(jobs.events(staged.id)):
            at = start + timedelta(seconds=number)
            progress.event(event.model_copy(update={"at": at}))
        progress.refresh()
    return text.getvalue()


def test_a_pipe_gets_a_line_for_each_point(client: redis.Redis) -> None:
    lines = shown(client, terminal=False, rule={"name": "reverse"}).splitlines()
    assert lines[0] == "queued: waiting for a worker"
    assert lines[1] == "rendering: rendering with scalar_rgb"
    assert [line.split()[0] for line in lines[2:]] == ["100", "200", "300"]
    last = lines[-1]
    # 32×24 pixels: 25 of them, and ε scaled from 512×512
    assert "changed 25 px (3.3 %)" in last
    assert "slope 0.125 px/spp (stops at 0.000293)" in last
    assert last.count("stops at") == 1
    assert "noise left 0.34 px (0.033 %)" in last
    # 11 slices of 25 spp in 11 s after the first
    assert f"{32 * 24 * 25 / 1e6:.2f} Msamples/s" in last
    assert "\x1b" not in "".join(lines)


def test_the_estimate_is_shown_with_the_target_where_that_is_the_rule(client: redis.Redis) -> None:
    last = shown(client, terminal=False).splitlines()[-1]
    assert "noise left 0.34 px (0.033 %) (stops at 0.02 %)" in last
    assert last.count("stops at") == 1


@pytest.mark.parametrize(
    ("narrower", "curve"), [({"width": 40}, True), ({"height": 11}, True), ({}, False)]
)
def test_the_curve_is_left_out_where_it_has_no_room_or_is_not_wanted(
    client: redis.Redis, narrower: dict[str, int], curve: bool
) -> None:
    text = shown(client, terminal=True, curve=curve, size={"width": 120, "height": 30, **narrower})
    assert "300 of at most 10,000 spp" in text
    assert not re.search("[\u2801-\u28ff]", text)


@pytest.mark.parametrize("terminal", [False, True])
def test_a_pause_is_told_of(client: redis.Redis, terminal: bool) -> None:
    staged, jobs = StagedJob(client), Jobs(client)
    staged.commit(12)
    staged.point(100, 5)
    jobs.pause(staged.id)
    text = io.StringIO()
    progress = progress_on(Console(file=text, force_terminal=terminal, width=120))
    with progress:
        for event in jobs.events(staged.id):
            progress.event(event)
        progress.job(job_view(jobs.get(staged.id)))
        paused = text.getvalue()
        jobs.resume(staged.id)
        progress.job(job_view(jobs.get(staged.id)))
    resumed = text.getvalue().removeprefix(paused)
    if terminal:
        assert f"paused by a user; `plateau resume {staged.id}` resumes it" in paused
        # Nobody renders it now: there is no rate
        assert "Msamples/s" not in paused
        assert "Msamples/s" in resumed
    else:
        assert paused.splitlines()[-1] == "paused: paused by a user"
        assert resumed.splitlines()[0] == "rendering: resumed by a user"
