"""The units of systemd: valid, hardened, and not so hard that nothing could be rendered."""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from plateau.farm.process.settings import Settings
from plateau.farm.redis.acl import rules
from plateau.processes.tree import _STOP_S

DEPLOY = Path(__file__).parents[2] / "deploy" / "systemd"
UNITS = ("plateau-api.service", "plateau-monitor.service", "plateau-worker@.service")
#: Of 10, by `systemd-analyze security`; a service without any hardening has 9.6.
MOST_EXPOSED = 1.5


@pytest.fixture(scope="module")
def machine(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The root of a machine on which the units are installed as deploy/README.md says."""
    root = tmp_path_factory.mktemp("machine")
    shutil.copytree("/lib/systemd/system", root / "usr/lib/systemd/system", symlinks=True)
    shutil.copytree(DEPLOY, root / "etc/systemd/system")
    program = root / "opt/plateau/bin/plateau"
    program.parent.mkdir(parents=True)
    program.touch(mode=0o755)
    return root


@pytest.fixture(scope="module")
def analyze(machine: Path, tool: Callable[[str], Path]) -> Callable[..., tuple[int, str]]:
    def run(*arguments: str) -> tuple[int, str]:
        ran = subprocess.run(
            [tool("systemd-analyze"), f"--root={machine}", "--no-pager", *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        )
        return ran.returncode, ran.stdout

    return run


def test_systemd_takes_every_line(analyze: Callable[..., tuple[int, str]]) -> None:
    installed = [unit.replace("@", "@1") for unit in UNITS]
    assert analyze("verify", "plateau.target", *installed) == (0, "")


@pytest.mark.parametrize("unit", UNITS)
def test_little_is_left_to_who_breaks_in(
    analyze: Callable[..., tuple[int, str]], unit: str
) -> None:
    most = f"--threshold={round(10 * MOST_EXPOSED)}"
    code, said = analyze("security", "--offline=yes", most, unit.replace("@", "@1"))
    assert code == 0, said


def unit(name: str) -> dict[str, list[str]]:
    """What the [Service] section says, with what the drop-in adds, by key."""
    found: dict[str, list[str]] = {}
    for file in (DEPLOY / name, DEPLOY / "plateau-.service.d" / "hardening.conf"):
        section = file.read_text().partition("[Service]")[2].partition("\n[")[0]
        for line in section.splitlines():
            if line and not line.startswith("#"):
                key, _, value = line.partition("=")
                found.setdefault(key, []).append(value)
    return found


@pytest.mark.parametrize("name", UNITS)
def test_each_part_is_a_user_of_its_own_and_has_the_time_that_it_needs(name: str) -> None:
    role = re.split(r"[-.@]", name)[1]
    service = unit(name)
    words = " ".join(service["Environment"])
    assert f"PLATEAU_REDIS_USER=plateau-{role}" in words
    assert f"plateau-{role}" in rules()
    (credential,) = service["LoadCredential"]
    assert credential == f"redis-password:/etc/plateau/redis/plateau-{role}.password"
    assert int(service["TimeoutStopSec"][0]) > _STOP_S[role]
    # The supervisor ends what it has started; nobody else is told to stop
    assert service["KillMode"] == ["mixed"]
    assert service["Restart"] == ["always"]


def test_every_setting_that_they_name_is_one(machine: Path) -> None:
    named = {
        name
        for file in (machine / "etc/systemd/system").rglob("*")
        if file.is_file()
        for name in re.findall(r"PLATEAU_[A-Z_]+", file.read_text())
    }
    settings = {f"PLATEAU_{name.upper()}" for name in Settings.model_fields}
    assert named - settings == {"PLATEAU_API_OPTIONS"}  # which is an argument of the unit's own


#: Runs a command under a filter that lets these system calls pass, as systemd's does.
_UNDER_FILTER = """
import ctypes, os, sys
names, command = sys.argv[1].split(","), sys.argv[2:]
library = ctypes.CDLL("libseccomp.so.2")
library.seccomp_init.restype = ctypes.c_void_p
context = ctypes.c_void_p(library.seccomp_init(ctypes.c_uint32(0x00050000 | 1)))  # else EPERM
known = 0
for name in names:
    number = library.seccomp_syscall_resolve_name(name.encode())
    if number >= 0:
        known += library.seccomp_rule_add(context, ctypes.c_uint32(0x7FFF0000), number, 0) == 0
assert known > 200, known
assert library.seccomp_load(context) == 0
os.execv(command[0], command)
"""


def test_what_is_rendered_needs_no_system_call_that_is_refused(
    tool: Callable[[str], Path], cache: Path, tmp_path: Path
) -> None:
    allowed: set[str] = set()
    for words in unit(UNITS[2])["SystemCallFilter"]:
        calls = {call for word in words.lstrip("~").split() for call in _expanded(tool, word)}
        allowed = allowed - calls if words.startswith("~") else allowed | calls
    assert "read" in allowed
    assert not {"mount", "ptrace", "init_module", "chroot", "reboot"} & allowed
    command = [sys.executable, "-m", "plateau", "render", "scenes:box", "-o", str(tmp_path / "out")]
    size = ["-D", "width=32", "-D", "height=32", "--max-spp", "200"]
    ran = subprocess.run(
        [sys.executable, "-c", _UNDER_FILTER, ",".join(allowed), *command, *size],
        env={**os.environ, "PLATEAU_CACHE": str(cache)},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    assert ran.returncode == 0, ran.stdout
    assert (tmp_path / "out" / "image.exr").exists()


def _expanded(tool: Callable[[str], Path], word: str) -> set[str]:
    """The system calls that a word of a filter means."""
    if not word.startswith("@"):
        return {word}
    said = subprocess.run(
        [tool("systemd-analyze"), "syscall-filter", word],
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    ).stdout
    inside = [line.strip() for line in said.splitlines()[1:] if line.strip()]
    return {call for one in inside if not one.startswith("#") for call in _expanded(tool, one)}
