"""What the long-lived processes of a farm hold, and whether it is flat: a robust trend, bounded."""

import re
from collections import defaultdict
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

import numpy as np
import psutil

from bench.support.report import Table

#: The share of a run in which caches may fill.
WARM_UP: Final = 1 / 3
#: What a process may grow after the warm-up: so many bytes, or a share of what it has, if more.
MOST_BYTES: Final = 8_000_000
MOST_SHARE: Final = 0.05
#: And so many descriptors, or threads: after a restart connections come back one after another.
MOST_COUNT: Final = 16

#: Own memory is anonymous pages: those of files are shared with processes that come and go.
MEASURED: Final = ("own memory, MB", "descriptors", "threads")
HEAD: Final = ("", *(f"{name}: {what}" for name in MEASURED for what in ("median", "growth")))


class Watch:
    """Samples of what each role's process holds, through its restarts: a row for each look."""

    def __init__(self) -> None:
        self.samples = defaultdict[str, list[tuple[float, ...]]](list)

    def look(self, minute: float, role: str, process: psutil.Process) -> None:
        """Take a sample, unless the process has just ended."""
        with suppress(psutil.NoSuchProcess, OSError):
            rollup = Path(f"/proc/{process.pid}/smaps_rollup").read_text()
            own = 1024 * int(re.findall(r"^Anonymous:\s+(\d+) kB$", rollup, re.MULTILINE)[0])
            held = (own, process.num_fds(), process.num_threads())
            self.samples[role].append((minute, *held))

    def findings(self) -> list[str]:
        """A line for whatever is not flat."""
        return [
            f"{role}: {name} grew by {growth:.0f} from {median:.0f}"
            for role, samples in self.samples.items()
            for name, (median, growth) in zip(MEASURED, _trends(samples), strict=True)
            if growth > (max(MOST_BYTES, MOST_SHARE * median) if "MB" in name else MOST_COUNT)
        ]

    def table(self) -> Table:
        """How all of it went so far."""
        rows = []
        for role, samples in self.samples.items():
            (own, *counts) = _trends(samples)
            figures = [f"{one / 1e6:.1f}" for one in own]
            rows.append([role, *figures, *(f"{one:.0f}" for trend in counts for one in trend)])
        return [list(HEAD), *rows]


def _trends(samples: Sequence[tuple[float, ...]]) -> list[tuple[float, float]]:
    """Return the median of each thing measured, and its growth, after the warm-up.

    The growth is the median slope between any two values (Theil and Sen), times the time that they
    cover. So neither a peak nor a restart is taken for growth, and no level.
    """
    times = np.array([minute for minute, *_ in samples])
    judged = times - times[0] >= WARM_UP * np.ptp(times)
    t = times[judged]
    first, second = np.triu_indices(t.size, 1)
    found = []
    for values in np.array(samples, float)[judged, 1:].T:
        slopes = (values[second] - values[first]) / (t[second] - t[first])
        found.append((float(np.median(values)), float(np.median(slopes) * np.ptp(t))))
    return found
