"""How much memory a process may have."""

import resource
import subprocess
import sys

from plateau.farm.process.memory import memory_bytes

_ASK = "from plateau.farm.process import memory as m; print(m.memory_bytes(), m.memory_left())"


def test_a_limit_of_its_own_is_what_it_has() -> None:
    most = min(2**30, memory_bytes())
    found = subprocess.run(
        [sys.executable, "-c", _ASK],
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_DATA, (most, most)),
        capture_output=True,
        check=True,
    )
    limit, left = map(int, found.stdout.split())
    assert limit == most
    assert most / 2 < left < most
