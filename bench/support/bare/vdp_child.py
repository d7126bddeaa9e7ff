"""One comparison of two .npy files in a fresh process, as `bench.vdp` starts it.

Prints the cost of starting, and the memory, as JSON.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

import numpy as np

started = time.process_time()
from plateau.metric import View  # noqa: E402
from plateau.metric.compiled import CompiledVisibleDifferences  # noqa: E402

import_s = time.process_time() - started


def main() -> None:
    reference, test = (np.load(file) for file in sys.argv[1:])
    metric = CompiledVisibleDifferences(View())

    started = time.process_time()
    kept = metric.percept(reference)
    kept.keep()
    metric.compare(kept, metric.percept(test))
    first_s = time.process_time() - started

    started = time.process_time()
    metric.compare(kept, metric.percept(test))
    again_s = time.process_time() - started

    json.dump(
        {
            "import_s": import_s,
            "first_s": first_s,
            "again_s": again_s,
            "peak_mib": peak_mib(),
        },
        sys.stdout,
    )


def peak_mib() -> float | None:
    """Return the most memory that this process has held; None if the system does not tell."""
    # `getrusage` would count the parent's as well.
    status = Path("/proc/self/status")
    if not status.exists():
        return None
    lines = dict(line.split(":", 1) for line in status.read_text().splitlines())
    return int(lines["VmHWM"].removesuffix("kB")) / 1024


if __name__ == "__main__":
    main()
