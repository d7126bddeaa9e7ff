"""A process that checks scenes for the API within the kernel's limits.

`plateau.service.api.scene_checks.process` starts it and talks to it over a socket: a question
(JSON) comes with the upload as an open file, and an answer (JSON) goes back. The process has no
credentials, and the kernel kills it when a check exceeds its CPU time.
"""

import json
import math
import os
import resource
import socket
import struct
import sys
import time
from dataclasses import asdict
from pathlib import Path
from typing import Any, BinaryIO, Final

from plateau.farm.bundle import BundleError, BundleLimits, inspect_each
from plateau.farm.process.lifecycle import limit

#: Before each message: its length in bytes.
_LENGTH: Final = struct.Struct("!I")
#: A second bound beside that of written memory: libraries are mapped, and more is reserved.
_ADDRESS_SPACE_BYTES: Final = 2**30
#: The socket, the upload, the standard streams, and modules that are imported late.
_OPEN_FILES: Final = 32
#: A process with more resident memory after a check ends, and the next check gets a new one.
_KEEP_BYTES: Final = 96 * 2**20
_RESIDENT: Final = Path("/proc/self/statm")


def main() -> None:
    """Answer the questions from the socket whose descriptor is the first argument."""
    link = socket.socket(fileno=int(sys.argv[1]))
    memory_bytes = int(sys.argv[2])
    limit(resource.RLIMIT_CORE, 0)
    limit(resource.RLIMIT_NOFILE, _OPEN_FILES)
    limit(resource.RLIMIT_DATA, memory_bytes)
    limit(resource.RLIMIT_AS, _ADDRESS_SPACE_BYTES)
    while True:
        header, files, _, _ = socket.recv_fds(link, _LENGTH.size, 1)
        if not header:
            return  # the API has ended
        question = received(link, header)
        with os.fdopen(files[0], "rb") as upload:
            answer = _answer(upload, question)
        answer["is_last"] = _resident_bytes() > _KEEP_BYTES
        send(link, answer)
        if answer["is_last"]:
            return


def send(link: socket.socket, message: dict[str, Any], file: int | None = None) -> None:
    """Send a message, and an open file if one is given."""
    text = json.dumps(message).encode()
    content = _LENGTH.pack(len(text)) + text
    sent = 0 if file is None else socket.send_fds(link, [content], [file])
    link.sendall(content[sent:])


def received(link: socket.socket, beginning: bytes = b"") -> dict[str, Any]:
    """The rest of the next message after this beginning; `EOFError` if the other side is gone."""
    header = beginning + _exactly(link, _LENGTH.size - len(beginning))
    message: dict[str, Any] = json.loads(_exactly(link, _LENGTH.unpack(header)[0]))
    return message


def _exactly(link: socket.socket, count: int) -> bytes:
    content = bytearray()
    while len(content) < count:
        chunk = link.recv(count - len(content))
        if not chunk:
            raise EOFError
        content += chunk
    return bytes(content)


def _answer(upload: BinaryIO, question: dict[str, Any]) -> dict[str, Any]:
    """Check the upload with each set of values until the time is up, but with at least one."""
    cpu_s, turn_s = question["cpu_s"], question["turn_s"]
    used_s = time.process_time()
    _, hard = resource.getrlimit(resource.RLIMIT_CPU)
    resource.setrlimit(resource.RLIMIT_CPU, (math.ceil(used_s + cpu_s), hard))
    sizes: list[tuple[int | None, int | None]] = []
    answer: dict[str, Any] = {"sizes": sizes}
    asked = [(values, sensor) for values, sensor in question["asked"]]
    try:
        for summary in inspect_each(upload, asked, BundleLimits(**question["limits"])):
            if not sizes:
                answer["summary"] = asdict(summary)
            sizes.append((summary.width, summary.height))
            if time.process_time() - used_s > turn_s:
                break
    except BundleError as error:
        answer["error"] = error.to_tell()
    except MemoryError:
        answer["out_of_memory"] = True
    answer["cpu_s"] = time.process_time() - used_s
    return answer


def _resident_bytes() -> int:
    """The process's resident memory; 0 if the system does not tell."""
    if not _RESIDENT.exists():
        return 0
    return int(_RESIDENT.read_text(encoding="utf-8").split()[1]) * resource.getpagesize()


if __name__ == "__main__":
    main()
