"""Time ColorVideoVDP in a process of its own, on the cores that it is given.

`python cvvdp_child.py WAY REFERENCE.npy TEST.npy`, with `ours` or `authors` as the way, prints the
JOD; then for each line that it reads the seconds that another comparison took, and at the end of
its input its peak memory in MiB. The authors' may be another environment's Python.
"""

from __future__ import annotations

import os
import resource
import sys
import time
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable


def main() -> None:
    way, *files = sys.argv[1:]
    reference, test = (np.load(file) for file in files)
    compare = {"ours": _ours, "authors": _authors}[way](reference, test)
    print(compare(), flush=True)
    for _ in sys.stdin:
        started = time.perf_counter()
        compare()
        print(time.perf_counter() - started, flush=True)
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024, flush=True)


def _ours(reference: Any, test: Any) -> Callable[[], float]:
    from plateau.metric.cvvdp import DISPLAYS, ColorVideoVDP

    model = ColorVideoVDP(DISPLAYS["standard_4k"], threads=len(os.sched_getaffinity(0)))
    return lambda: model.compare(model.percept(reference), model.percept(test)).jod


def _authors(reference: Any, test: Any) -> Callable[[], float]:
    import pycvvdp
    import torch

    torch.set_num_threads(len(os.sched_getaffinity(0)))
    torch.set_grad_enabled(False)
    model = pycvvdp.cvvdp(display_name="standard_4k", device=torch.device("cpu"), quiet=True)
    return lambda: float(model.predict(test, reference, dim_order="HWC")[0])


if __name__ == "__main__":
    main()
