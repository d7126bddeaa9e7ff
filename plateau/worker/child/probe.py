"""Has the renderer of a variant render a known image, and prints OK and a digest of its bits.

A process of its own, since a library that does not suit the machine may abort it. It shuts itself
in as a render child does: a library that the confinement keeps away would not suit either.
"""

import os
import resource
import signal
import sys
from pathlib import Path

from plateau.worker.child.shut_in import shut_in


def main(variant: str) -> None:
    """Probe the renderer; any failure ends the process."""
    # Ctrl-C in a terminal reaches this process too, and has to end it as a signal does: within
    # Mitsuba, Python's KeyboardInterrupt becomes other errors, and aborts. It was held back so far.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))  # an abort is expected here: no core file
    kernels = Path(os.environ["DRJIT_CACHE_DIR"])
    shut_in(variant, "plateau.worker.child.probe", scenes=(), kernels=kernels)
    # Imported here: numpy starts threads.
    from plateau.worker.renderers.contract import renderer_for

    canary = renderer_for(variant, threads=len(os.sched_getaffinity(0))).probe()
    canary.check()
    print("OK", canary.bits)


if __name__ == "__main__":
    main(sys.argv[1])
