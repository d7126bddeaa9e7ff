"""A process that checks scenes for the API within the kernel's limits.

`plateau.service.api.scene_checks.process` asks it: a question (JSON) comes with the upload as an
open file, and an answer (JSON) goes back. The kernel kills it when a check exceeds its CPU time.
"""

import json
import math
import os
import resource
import socket
import sys
import time
from dataclasses import asdict
from typing import Any, BinaryIO, Final

from plateau.farm.bundle import BundleError, BundleLimits, inspect_each
from plateau.farm.process.child import parent, read_part, write_part
from plateau.farm.process.lifecycle import limit
from plateau.farm.process.memory import resident_bytes

#: A second bound beside that of written memory: libraries are mapped, and more is reserved.
_ADDRESS_SPACE_BYTES: Final = 2**30
#: The socket, the upload, the standard streams, and modules that are imported late.
_OPEN_FILES: Final = 32
#: A process with more resident memory after a check ends, and the next check gets a new one.
_KEEP_BYTES: Final = 96 * 2**20


def main() -> None:
    """Answer the questions of its parent; the second argument is the memory that it may use."""
    memory_bytes = int(sys.argv[2])
    limit(resource.RLIMIT_CORE, 0)
    limit(resource.RLIMIT_NOFILE, _OPEN_FILES)
    limit(resource.RLIMIT_DATA, memory_bytes)
    limit(resource.RLIMIT_AS, _ADDRESS_SPACE_BYTES)
    with parent() as link, link.makefile("rb") as questions, link.makefile("wb") as answers:
        while files := socket.recv_fds(link, 1, 1)[1]:  # none once the API has ended
            with os.fdopen(files[0], "rb") as upload:
                answer = _answer(upload, json.loads(read_part(questions)))
            answer["is_last"] = "out_of_memory" in answer or resident_bytes() > _KEEP_BYTES
            write_part(answers, json.dumps(answer).encode())
            answers.flush()
            if answer["is_last"]:
                return


def _answer(upload: BinaryIO, question: dict[str, Any]) -> dict[str, Any]:
    """Check the upload with each set of values until the time is up, but with at least one."""
    over_s = time.process_time() + question["total_s"]
    _limit_cpu(question["cpu_s"])
    sizes: list[tuple[int | None, int | None]] = []
    answer: dict[str, Any] = {"sizes": sizes}
    asked = [(values, sensor) for values, sensor in question["asked"]]
    try:
        for summary in inspect_each(upload, asked, BundleLimits(**question["limits"])):
            if not sizes:
                answer["summary"] = asdict(summary)
            sizes.append((summary.width, summary.height))
            if time.process_time() > over_s:
                break
            _limit_cpu(question["cpu_s"])
    except BundleError as error:
        answer["error"] = error.to_tell()
    except (MemoryError, SystemError):  # C code that lacks memory may not say what it lacks
        answer["out_of_memory"] = True
    return answer


def _limit_cpu(more_s: float) -> None:
    """Let the process take so much more CPU time."""
    _, hard = resource.getrlimit(resource.RLIMIT_CPU)
    resource.setrlimit(resource.RLIMIT_CPU, (math.ceil(time.process_time() + more_s), hard))


if __name__ == "__main__":
    main()
