"""The live curve as it is seen on a real terminal."""

import itertools
import json
import re
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest
import redis

from tests.support.farms.staged_job import StagedJob
from tests.support.processes.commands import starting
from tests.support.processes.terminal import Terminal

NAMES = ("changed", "noise left", "target")
DOTS = re.compile("[\u2801-\u28ff]")
COLOUR = re.compile(rb"\x1b\[[0-9;]*3[0-7]m")

Watch = Callable[..., Terminal]


@pytest.fixture
def job(client: redis.Redis) -> StagedJob:
    """A job with two points of its curve."""
    job = StagedJob(client, max_spp=2000)
    job.commit(8)
    for spp in (100, 200):
        job.point(spp, spp // 10)
    return job


@pytest.fixture
def watch(api: str, job: StagedJob) -> Iterator[Watch]:
    yield from starting(
        lambda *options, **more: closing(Terminal("watch", job.id, "--url", api, *options, **more))
    )


def has_curve(lines: list[str]) -> bool:
    """Whether all of it is there, to its last line."""
    return sum(map(bool, map(DOTS.search, lines))) >= 2 and len(ticks(lines)) > 2


def ticks(lines: list[str]) -> list[int]:
    """The spp below the chart."""
    for axis, below in itertools.pairwise(lines):
        if axis.rstrip().endswith("(spp)"):
            return [int(one.replace(",", "")) for one in re.findall(r"[\d,]+", below)]
    return []


def width(lines: list[str]) -> int:
    return max(len(line) for line in lines if line.rstrip().endswith("(spp)"))


def named(lines: list[str], word: str) -> int:
    """How many lines of the chart name a line of it so."""
    return sum(word in line.partition(" | ")[2] for line in lines)


def test_it_grows_with_each_point_and_stays_when_the_job_has_ended(
    watch: Watch, job: StagedJob
) -> None:
    terminal = watch()
    lines = terminal.until(has_curve)
    assert 150 < ticks(lines)[-1] <= 200
    assert {named(lines, name) for name in NAMES} == {1}
    # A new point is drawn
    job.commit(40)
    job.point(1200, 400)
    terminal.until(lambda lines: max(ticks(lines), default=0) > 1000)
    job.end(reason="levelled off")
    job.finish(1200)
    assert terminal.exit_code() == 0
    lines = terminal.lines()
    assert has_curve(lines)
    assert named(lines, "target") == 1
    assert any(line.split() == ["reason:", "levelled", "off"] for line in lines)
    assert not terminal.screen.cursor.hidden
    assert COLOUR.search(terminal.written)


def test_it_fits_again_when_the_terminal_changes_its_size(watch: Watch) -> None:
    terminal = watch(columns=80, NO_COLOR="1")
    before = width(terminal.until(has_curve))
    for columns in (60, 95):
        terminal.resize(columns, 30)

        def fits(lines: list[str], before: int = before) -> bool:
            fresh = has_curve(lines) and width(lines) != before
            return fresh and all(named(lines, name) for name in NAMES)

        lines = terminal.until(fits)
        before = width(lines)
        # Once, and nothing is left of what was drawn before
        assert sum("at most 2,000 spp" in line for line in lines) == 1
        assert {named(lines, name) for name in NAMES} == {1}
    # And without colours, where they are not wanted
    assert not COLOUR.search(terminal.written)


def test_it_is_left_out_where_nobody_wants_it(watch: Watch, job: StagedJob) -> None:
    terminal = watch("--no-curve")
    terminal.until(lambda lines: any("changed 20 px" in line for line in lines))
    job.end()
    job.finish(200)
    assert terminal.exit_code() == 0
    assert not has_curve(terminal.lines())


def test_a_dumb_terminal_gets_lines(watch: Watch) -> None:
    terminal = watch(TERM="dumb")
    terminal.until(lambda lines: any("200 spp" in line for line in lines))
    assert b"\x1b" not in terminal.written


def test_it_stays_out_of_standard_output(watch: Watch, job: StagedJob, tmp_path: Path) -> None:
    with (tmp_path / "said").open("wb") as said:
        terminal = watch("--json", stdout=said.fileno())
        terminal.until(has_curve)
        job.end()
        job.finish(200)
        assert terminal.exit_code() == 0
    assert json.loads((tmp_path / "said").read_text())["state"] == "converged"


def test_a_curve_is_drawn_below_its_points(api: str, job: StagedJob) -> None:
    with closing(Terminal("show", "--curve", job.id, "--url", api)) as terminal:
        assert terminal.exit_code() == 0
        lines = terminal.lines()
    assert re.match(r" +100 spp  changed 10 px", lines[0])
    assert has_curve(lines)
