"""Children: processes that run a module of Plateau's without its credentials, and die with it.

`start` starts one. A `Child` also has a socket to its parent, and what it prints is kept. It may be
asked one question after the other: then parts go between the two, each after its length.
"""

import fcntl
import logging
import os
import re
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from typing import IO, Any, Final

from plateau.farm.process.lifecycle import die_with_parent, plain_environment

_LOG = logging.getLogger(__name__)

#: What is wrong with a process that no signal ends, in words.
HANGS: Final = "it waits for a disk, a network mount or a device that does not answer"
#: A killed child that is there for longer is one of those.
GONE_S: Final = 10.0
_POLL_S: Final = 0.01  #: between two checks whether a killed child is gone

_MOST_BYTES: Final = 4096  #: of one reading of what a child prints
_COLOURS: Final = re.compile(r"\x1b\[[0-9;]*m")
_LENGTH: Final = struct.Struct("<Q")
#: Of a child that serves, below its parent, as a worker's renderer is.
_NICENESS: Final = 10


class NoAnswer(Exception):
    """The child did not answer; it may if it is asked again.

    Attributes
    ----------
    status : int or None
        With which it ended, as `subprocess` has it; None where it was too late.
    """

    def __init__(self, words: str, status: int | None = None) -> None:
        super().__init__(words)
        self.status = status


def start(
    module: str,
    *arguments: object,
    environment: Mapping[str, str] | None = None,
    prepare: Callable[[], None] | None = None,
    user_site: bool = True,
    **streams: Any,
) -> subprocess.Popen[bytes]:
    """Start a module, as the leader of a process group of its own, with no input.

    It dies with the thread that starts it.

    Parameters
    ----------
    module, arguments
        What to run.
    environment
        By default this process's without credentials.
    prepare
        Called in the child before its program.
    user_site
        Whether it may import from the user's own site-packages.
    streams
        More of `subprocess.Popen`.
    """
    arrange = die_with_parent(signal.SIGKILL)

    def before_the_program() -> None:
        arrange()
        if prepare is not None:
            prepare()

    return subprocess.Popen(
        [sys.executable, *([] if user_site else ["-s"]), "-m", module, *map(str, arguments)],
        env=plain_environment() if environment is None else environment,
        stdin=subprocess.DEVNULL,
        start_new_session=True,
        preexec_fn=before_the_program,
        **streams,
    )


class Words:
    """What a child prints, in a file without a name: nothing of it remains, whoever dies."""

    def __init__(self) -> None:
        #: For the child's standard output and error.
        self.file: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115  (see `close`)
        # The child then writes at the end, also after the file was emptied.
        fcntl.fcntl(self.file, fcntl.F_SETFL, os.O_APPEND)
        self._left = ""  # the words of a dead child

    def take(self) -> str:
        """Return the end of what was printed since the last call: 4 KB at most, uncoloured."""
        words = self.read()
        self._left = ""
        if not self.file.closed:
            os.ftruncate(self.file.fileno(), 0)
        return words

    def read(self) -> str:
        """Return the same, and leave it there."""
        if self.file.closed:
            return self._left
        # By position: the child shares the file's offset.
        file = self.file.fileno()
        start = max(0, os.fstat(file).st_size - _MOST_BYTES)
        words = os.pread(file, _MOST_BYTES, start).decode(errors="replace")
        return _COLOURS.sub("", words).strip()

    def close(self) -> None:
        """Keep the words that were not taken, and close the file."""
        self._left = self.read()
        self.file.close()


class Child:
    """A child with a socket, whose descriptor is its first argument; parameters as of `start`.

    Attributes
    ----------
    link : socket
        This side's end.
    words : Words
        What it prints.
    """

    def __init__(
        self, module: str, *arguments: object, pass_fds: Collection[int] = (), **options: Any
    ) -> None:
        self.words = Words()
        self.link, theirs = socket.socketpair()
        with theirs:
            self._process = start(
                module,
                theirs.fileno(),
                *arguments,
                pass_fds=(theirs.fileno(), *pass_fds),
                stdout=self.words.file,
                stderr=self.words.file,
                **options,
            )
        self._is_killed = self._is_over = False

    @property
    def pid(self) -> int:
        """Its process id."""
        return self._process.pid

    @property
    def is_alive(self) -> bool:
        """Whether it runs, and was not killed."""
        return not self._is_killed and self._process.poll() is None

    def wait(self) -> int:
        """Return its status once it has ended."""
        return self._process.wait()

    def kill(self) -> None:
        """Kill it and all that it has started; may be called from any thread."""
        self._is_killed = True
        if not self._is_over:  # its number may be another's by now
            with suppress(ProcessLookupError):
                os.killpg(self.pid, signal.SIGKILL)

    def end(self) -> None:
        """Kill it, wait until it is gone, and close what it has; harmless to repeat.

        One that waits for a disk that does not answer ends when the disk answers.
        """
        if self._is_over:
            return
        self.kill()
        gone_by = time.monotonic() + GONE_S
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(GONE_S)
        while self._is_there() and time.monotonic() < gone_by:
            time.sleep(_POLL_S)
        if self._is_there():
            _LOG.error("the killed child process %d is still there: %s", self.pid, HANGS)
        self._is_over = True
        self.link.close()
        self.words.close()

    def _is_there(self) -> bool:
        """Return whether any process of the group is left, the child or what it started."""
        try:
            os.killpg(self.pid, 0)
        except ProcessLookupError:
            return False
        return True

    def ask(
        self, write: Callable[[IO[bytes]], object], limit_s: float, file: IO[bytes] | None = None
    ) -> bytes:
        """Return the answer to the question that `write` writes, an open file with it if given.

        After an error the child is of no use any more.

        Raises
        ------
        NoAnswer
            The child ended, or took longer than `limit_s` and was killed.
        """
        is_late = threading.Event()

        def end() -> None:
            is_late.set()
            self.kill()

        deadline = threading.Timer(limit_s, end)
        deadline.start()
        try:
            with suppress(ConnectionError):  # its end says why
                if file is not None:
                    socket.send_fds(self.link, [b"\0"], [file.fileno()])
                with self.link.makefile("wb") as stream:
                    write(stream)
            with self.link.makefile("rb") as answers:
                return read_part(answers)
        except (EOFError, ConnectionError):
            status = self.wait()
            if is_late.is_set():
                raise NoAnswer(f"it took more than {limit_s:.0f} s") from None
            said = self.words.read().rpartition("\n")[2]
            raise NoAnswer(said or f"its process ended with status {status}", status) from None
        finally:
            deadline.cancel()


def serve(answer: Callable[[IO[bytes]], bytes | memoryview]) -> None:
    """Answer the questions of `Child.ask`, which `answer` reads, each whole; for its program.

    An exception ends the process; the parent has its last line.
    """
    os.nice(_NICENESS)
    with parent() as link, link.makefile("rb") as questions, link.makefile("wb") as answers:
        while questions.peek(1):
            write_part(answers, answer(questions))
            answers.flush()


def parent() -> socket.socket:
    """Return a child's end of its socket."""
    return socket.socket(fileno=int(sys.argv[1]))


def write_part(stream: IO[bytes], content: bytes | memoryview) -> None:
    """Write a part; the stream may hold it back until it is flushed."""
    stream.write(_LENGTH.pack(len(content)))
    stream.write(content)


def read_part(stream: IO[bytes]) -> bytes:
    """Return the next part; raises EOFError where the stream ends before its end."""
    head = stream.read(_LENGTH.size)
    if len(head) == _LENGTH.size:
        (length,) = _LENGTH.unpack(head)
        content = stream.read(length)
        if len(content) == length:
            return content
    raise EOFError("the stream has ended")
