"""What each folder of tests costs: ``pytest --cost`` tells at the end, in Markdown."""

import os
from collections import Counter
from contextlib import suppress
from pathlib import Path
from typing import Any

import psutil
import pytest

TESTS = Path(__file__).parents[1]
AROUND = "start and end"


def cpu_s() -> float:
    """What this process, and all that it has started, have computed so far."""
    found = sum(os.times()[:4])
    for one in psutil.Process().children(recursive=True):
        with suppress(psutil.Error):
            found += sum(one.cpu_times()[:4])
    return found


class Cost:
    """Counts in each process of ``-n``, and adds up and tells in the one that started them.

    `counts`: whether tests run in this process.
    """

    def __init__(self, counts: bool) -> None:
        self._counts = counts
        self.cpu_s: dict[str, float] = {}
        self.cases: Counter[str] = Counter()
        self._before, self._file, self._folder = 0.0, TESTS, AROUND

    def _settle(self, file: Path, folder: str) -> None:
        """Count what was computed since the last file of tests began, where another begins."""
        if file != self._file:
            now = cpu_s()
            self._add({self._folder: now - self._before})
            self._before, self._file, self._folder = now, file, folder

    def _add(self, cpu_s: dict[str, float]) -> None:
        for folder, seconds in cpu_s.items():
            self.cpu_s[folder] = self.cpu_s.get(folder, 0.0) + seconds

    def pytest_runtest_logstart(self, location: tuple[str, int | None, str]) -> None:
        if not self._counts:
            return
        parts = Path(location[0]).parts
        self._settle(Path(location[0]), parts[1])
        self.cases[parts[1]] += 1

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        if self._counts:
            self._settle(TESTS / AROUND, AROUND)
        if hasattr(session.config, "workeroutput"):
            session.config.workeroutput["cost"] = (self.cpu_s, dict(self.cases))

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: Any) -> None:
        cpu_s, cases = getattr(node, "workeroutput", {}).get("cost", ({}, {}))
        self._add(cpu_s)
        self.cases.update(cases)

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        rows = sorted(self.cpu_s.items(), key=lambda one: -one[1])
        terminalreporter.write_line("| tests | CPU seconds | cases | lines |\n|---|---|---|---|")
        for folder, seconds in (*rows, ("all", sum(self.cpu_s.values()))):
            cases = self.cases.total() if folder == "all" else self.cases[folder]
            lines = _lines(TESTS if folder == "all" else TESTS / folder)
            terminalreporter.write_line(f"| {folder} | {seconds:.0f} | {cases:,} | {lines:,} |")


def _lines(path: Path) -> int:
    files = [path] if path.is_file() else path.rglob("*.py")
    return sum(len(file.read_text().splitlines()) for file in files)
