"""Renders one small image in the Mitsuba variant that it is given, and prints OK.

A process of its own, since an LLVM that does not suit the machine aborts it; shut in as a render
child is, since a library that this keeps from it would not suit either.
"""

import os
import resource
import signal
import sys
from pathlib import Path

from plateau.worker.confinement.confine import confine


def main(variant: str) -> None:
    """Render a small Cornell box with a path tracer; any failure ends the process."""
    # Ctrl-C in a terminal reaches this process too, and has to end it as a signal does: within
    # Mitsuba, Python's KeyboardInterrupt becomes other errors, and aborts. It was held back so far.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))  # an abort is expected here: no core file
    if not variant.startswith("cuda"):  # as in `plateau.worker.child`
        confine(scenes=(), kernels=Path(os.environ["DRJIT_CACHE_DIR"]))
    import mitsuba as mi
    import numpy as np

    mi.set_variant(variant)
    scene = mi.cornell_box()
    scene["sensor"]["film"].update(width=16, height=16)
    image = np.array(mi.render(mi.load_dict(scene), spp=4, seed=1))
    if not (np.isfinite(image).all() and image.mean() > 0):
        raise SystemExit("the image is black or not finite")
    print("OK")


if __name__ == "__main__":
    main(sys.argv[1])
