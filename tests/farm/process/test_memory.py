"""How much memory a process may have."""

import resource
import subprocess
import sys
from pathlib import Path

import pytest

from plateau.farm.process import memory
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


def test_the_limits_of_its_control_groups_count(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Given a limit of the process's own group, of whichever version, and none around it
    _, hierarchy, path = Path("/proc/self/cgroup").read_text("utf-8").splitlines()[-1].split(":", 2)
    own = tmp_path / path.strip("/")
    own.mkdir(parents=True, exist_ok=True)
    for group, limit in ((tmp_path, "max\n"), (own, "4096\n")):
        (group / "limit").write_text(limit, "utf-8")
    monkeypatch.setattr(memory, "_LIMITS", {hierarchy: (tmp_path, "limit")})
    assert list(memory._of_groups()) == [4096]
