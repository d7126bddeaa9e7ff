"""The actor of a worker, which Ray sends to nodes as it is: it imports nothing of Plateau's."""

import ctypes
import os
import signal
import subprocess
import tempfile
from collections.abc import Mapping

#: The exit code 72 is `plateau.engines.front.CANNOT_IMPORT`.
_PROGRAM = """
import sys
try:
    from plateau.engines.node import main
except ImportError as error:
    print(f"{sys.executable}: {error}", file=sys.stderr)
    sys.exit(72)
main()
"""
_LAST_WORDS = 400  #: bytes
_PR_SET_PDEATHSIG = 1


class Worker:
    """One worker, in a process of its own."""

    def where(self) -> str:
        """The name of the node."""
        return os.uname().nodename

    def run(self, python: str, environment: Mapping[str, str]) -> tuple[int, str]:
        """Run a worker to its end, by this interpreter; returns its exit code and last words."""
        c_library = ctypes.CDLL(None)
        with tempfile.TemporaryFile() as said:
            try:
                code = subprocess.run(
                    [python, "-c", _PROGRAM],
                    env={**os.environ, **environment},
                    stdin=subprocess.DEVNULL,
                    stdout=said,
                    stderr=said,
                    # It ends with this actor.
                    preexec_fn=lambda: c_library.prctl(_PR_SET_PDEATHSIG, signal.SIGTERM),
                    check=False,
                ).returncode
            except OSError as error:  # there is no such interpreter
                return 127, str(error)
            said.seek(max(0, said.seek(0, os.SEEK_END) - _LAST_WORDS))
            return code, " ".join(said.read().decode(errors="replace").split())
