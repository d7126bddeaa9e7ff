"""Toxiproxy: what comes through it comes late, or slowly."""

import json
import subprocess
import sys
import time
from pathlib import Path
from types import TracebackType
from typing import Any, Final

#: Asks toxiproxy's API, from the host on which it runs.
_ASK: Final = """
import sys, urllib.request
body = sys.argv[2].encode() or None
with urllib.request.urlopen(sys.argv[1], body, timeout=10) as answer:
    print(answer.read().decode())
"""


class Toxiproxy:
    """A toxiproxy on a host, until the context ends.

    Parameters
    ----------
    program
        The server.
    port
        Of its API, on the host's own address 127.0.0.1.
    inside
        What a command begins with that is to run on the host; see `Network.on`.
    """

    def __init__(self, program: Path, port: int = 8474, inside: tuple[str, ...] = ()) -> None:
        self._api = f"http://127.0.0.1:{port}"
        self._inside = inside
        self._command = (*inside, str(program), "-host", "127.0.0.1", "-port", str(port))

    def __enter__(self) -> "Toxiproxy":
        self._process = subprocess.Popen(
            self._command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        deadline = time.monotonic() + 60
        while self._ask("/version") is None:
            assert time.monotonic() < deadline, "toxiproxy did not start"
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._process.terminate()
        self._process.wait(60)

    def forward(self, name: str, listen: str, upstream: str) -> None:
        """Forward what comes to one address to another."""
        proxy = {"name": name, "listen": listen, "upstream": upstream, "enabled": True}
        assert self._ask("/proxies", proxy) is not None

    def delay(self, name: str, ms: int) -> None:
        """Let the answers come so much later."""
        self._add(name, "latency", latency=ms)

    def narrow(self, name: str, kb_per_s: int) -> None:
        """Let so many KB a second through, in each direction."""
        self._add(name, "bandwidth", rate=kb_per_s)
        self._add(name, "bandwidth", "upstream", rate=kb_per_s)

    def _add(self, name: str, kind: str, stream: str = "downstream", **how: int) -> None:
        toxic = {"type": kind, "stream": stream, "attributes": how}
        assert self._ask(f"/proxies/{name}/toxics", toxic) is not None

    def _ask(self, path: str, body: dict[str, Any] | None = None) -> str | None:
        """What the API answers; None where it does not."""
        sent = "" if body is None else json.dumps(body)
        command = (*self._inside, sys.executable, "-c", _ASK, self._api + path, sent)
        asked = subprocess.run(command, text=True, capture_output=True)
        return asked.stdout if asked.returncode == 0 else None
