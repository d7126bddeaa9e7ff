"""What the long-lived processes of a farm hold: memory, descriptors and threads."""

import contextlib
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import psutil

from tests.soak.flatness import Trend, trend

#: What a process may grow after the warm-up: so many bytes, or a share of what it has, if more.
MOST_BYTES: Final = 8_000_000
MOST_SHARE: Final = 0.05
#: And so many descriptors, or threads: after a restart connections come back one after another.
MOST_COUNT: Final = 16

_KB: Final = re.compile(r"^(Rss|Pss|Anonymous):\s+(\d+) kB$", re.MULTILINE)
MEASURED: Final = ("own", "rss", "pss", "descriptors", "threads")


@dataclass(frozen=True, kw_only=True)
class Held:
    """What a process holds at a moment: bytes, and numbers.

    Its own memory is its anonymous pages. Pages of files are shared with other processes, so their
    share (PSS) changes whenever one of these starts or ends.
    """

    own: int
    rss: int
    pss: int
    descriptors: int
    threads: int

    @classmethod
    def by(cls, process: psutil.Process) -> "Held":
        """Return what it holds now; raises `psutil.NoSuchProcess` and `OSError` if it has ended."""
        rollup = Path(f"/proc/{process.pid}/smaps_rollup").read_text()
        kb = {name: 1024 * int(number) for name, number in _KB.findall(rollup)}
        return cls(
            own=kb["Anonymous"],
            rss=kb["Rss"],
            pss=kb["Pss"],
            descriptors=process.num_fds(),
            threads=process.num_threads(),
        )


@dataclass
class Watch:
    """Series of what each role's process holds, through its restarts."""

    times: dict[str, list[float]] = field(default_factory=dict)  #: in minutes
    series: dict[str, list[Held]] = field(default_factory=dict)
    pids: dict[str, set[int]] = field(default_factory=dict)

    def look(self, minute: float, processes: Mapping[str, psutil.Process | None]) -> None:
        """Take a sample of those that live."""
        for role, process in processes.items():
            if process is None:
                continue
            with contextlib.suppress(psutil.NoSuchProcess, OSError):
                held = Held.by(process)
                self.times.setdefault(role, []).append(minute)
                self.series.setdefault(role, []).append(held)
                self.pids.setdefault(role, set()).add(process.pid)

    def trends(self, role: str) -> dict[str, Trend]:
        """How each of `MEASURED` went in this role."""
        return {
            name: trend(self.times[role], [getattr(one, name) for one in self.series[role]])
            for name in MEASURED
        }

    def in_words(self) -> str:
        """How all of it went so far: what a run that fails has found until then."""
        return "; ".join(
            f"{role}'s {name} grew by {found.growth:.0f} from {found.middle:.0f}"
            for role in self.series
            for name, found in self.trends(role).items()
        )

    def findings(self) -> list[str]:
        """A line for whatever is not flat."""
        return [
            f"{role}: {name} grew by {found.growth:.0f} from {found.middle:.0f}"
            for role in self.series
            for name, found in self.trends(role).items()
            if name in {"own", "descriptors", "threads"} and found.growth > most(name, found)
        ]


def most(name: str, found: Trend) -> float:
    """By how much it may grow."""
    if name == "own":
        return max(MOST_BYTES, MOST_SHARE * found.middle)
    return MOST_COUNT
