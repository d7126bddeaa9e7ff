"""Run the suite again and again, quiet and busy, and say which tests failed how often.

``make test-stress RUNS=20 LOAD=4`` runs `make test`'s tests so many times. Every second run has
busy neighbours: as many processes as LOAD says keep the cores at work, and in the last of these
runs one more keeps the disk at work. Half of the runs of each sort take the files of tests in
random order. The tables at the end, or when Ctrl-C ends it, are in Markdown, for CONTRIBUTING.md.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from statistics import median
from typing import Final, NamedTuple
from xml.etree import ElementTree as ET

ROOT: Final = Path(__file__).parents[1]
_BUSY: Final = "while True: pass"
_BUSY_DISK: Final = """
import os, sys
while True:
    with open(sys.argv[1], "wb") as file:
        for _ in range(64):
            file.write(bytes(1 << 20))
        os.fsync(file.fileno())
"""


class Run(NamedTuple):
    """One run of the suite: what was beside it, how long it took, and what failed."""

    beside: str
    minutes: float
    failed: list[str]


def plan(runs: int, load: int) -> list[tuple[int, bool, int | None]]:
    """For each run how many busy processes, whether a busy disk, and the seed of the order."""
    last_busy = max((run for run in range(runs) if run % 2), default=-1)
    return [
        (load if run % 2 else 0, run == last_busy, run + 1 if run // 2 % 2 else None)
        for run in range(runs)
    ]


def failures(report: Path) -> list[str]:
    """Name the tests that a report in JUnit's format says failed, at any of their stages."""
    cases = ET.parse(report).iter("testcase")
    return [
        f"{case.get('classname')}::{case.get('name')}"
        for case in cases
        if case.find("failure") is not None or case.find("error") is not None
    ]


@contextmanager
def neighbours(load: int, disk: bool) -> Iterator[None]:
    """Keep this machine busy meanwhile."""
    with ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="stress-"))
        commands = [[sys.executable, "-c", _BUSY]] * load
        if disk:
            commands.append([sys.executable, "-c", _BUSY_DISK, f"{folder}/busy"])
        for command in commands:
            process = subprocess.Popen(command)
            stack.callback(process.wait)
            stack.callback(process.kill)
        yield


def run_suite(load: int, disk: bool, order: int | None, arguments: list[str]) -> Run:
    """Run the suite once, with its output in this terminal."""
    beside = f"{load} busy processes" if load else "quiet"
    beside += " and a busy disk" if disk else ""
    with tempfile.TemporaryDirectory(prefix="stress-") as folder, neighbours(load, disk):
        report = Path(folder) / "report.xml"
        command = [sys.executable, "-m", "pytest", "-q", "--junitxml", str(report), *arguments]
        if order is not None:
            command += ["--file-order", str(order)]
        start = time.monotonic()
        with subprocess.Popen(command, cwd=ROOT) as suite:
            try:
                ended = suite.wait()
            except KeyboardInterrupt:  # which the suite has heard too
                with suppress(subprocess.TimeoutExpired):
                    suite.wait(60)
                suite.kill()
                raise
        failed = failures(report) if report.exists() else []
        if ended and not failed:
            failed = [f"pytest exited with {ended}"]
        return Run(beside, (time.monotonic() - start) / 60, failed)


def tables(runs: list[Run]) -> str:
    """Give a row for each sort of run, and one for each test that failed."""
    lines = ["| runs | number | red | median | longest |", "|---|---|---|---|---|"]
    for sort in (*dict.fromkeys(run.beside for run in runs), "all"):
        some = [run for run in runs if sort in {run.beside, "all"}]
        minutes, red = [run.minutes for run in some], sum(bool(run.failed) for run in some)
        times = f"{median(minutes):.1f} min | {max(minutes):.1f} min" if some else "– | –"
        lines.append(f"| {sort} | {len(some)} | {red} | {times} |")
    counts = Counter(name for run in runs for name in run.failed)
    if counts:
        lines += ["", f"| test | red, of {len(runs)} |", "|---|---|"]
        lines += [f"| `{name}` | {count} |" for name, count in counts.most_common()]
    return "\n".join(lines)


def main() -> None:
    """Run as the command line says; the exit status is 1 where a run was not green."""
    parser = argparse.ArgumentParser(prog="python -m tests.stress", description=__doc__)
    parser.add_argument("--runs", type=int, default=20, help="how often (20)")
    parser.add_argument("--load", type=int, default=4, help="busy processes beside a busy run (4)")
    parser.add_argument("arguments", nargs="*", help="for pytest: which tests, and how; after --")
    options = parser.parse_args()
    os.environ.setdefault("CI", "true")  # where a test would be skipped elsewhere, it fails
    runs: list[Run] = []
    try:
        for number, (load, disk, order) in enumerate(plan(options.runs, options.load), 1):
            runs.append(run_suite(load, disk, order, options.arguments))
            shuffled = "" if order is None else f", files in random order (seed {order})"
            print(
                f"run {number} of {options.runs}, {runs[-1].beside}{shuffled}: "
                f"{runs[-1].minutes:.1f} minutes, red: {', '.join(runs[-1].failed) or 'none'}",
                flush=True,
            )
    except KeyboardInterrupt:
        sys.exit(130)
    finally:
        print(tables(runs), flush=True)
    sys.exit(any(run.failed for run in runs))


if __name__ == "__main__":
    main()
