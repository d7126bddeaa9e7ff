"""A render child that was taken over reaches nothing: not its supervisor, nor files, nor others."""

import json
import os
import platform
import shutil
import socket
import stat
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from subprocess import PIPE

import pytest
from typer.testing import CliRunner

from plateau.commands import app
from plateau.farm.model.states import JobState
from plateau.worker.supervisor import variants
from tests.support.farms.real_farm import BOX, RealFarm
from tests.support.faults import hostile_child
from tests.support.until import until

pytestmark = pytest.mark.skipif(
    sys.platform != "linux" or platform.machine() != "x86_64",
    reason="the attacks are made of Linux's system calls on x86_64",
)

#: The kernel says no (EPERM, EACCES). Any other error would be the attack's own.
REFUSED = {"EPERM", "EACCES", "EXDEV"}  # the last by Landlock, for links


@pytest.fixture
def victims(tmp_path: Path) -> Iterator[dict[str, str]]:
    """What is to be attacked, beside the supervisor: files, and servers that take connections."""
    (tmp_path / "data").mkdir()
    secret, redis = tmp_path / "data" / "credentials", tmp_path / "redis.sock"
    secret.write_text("swordfish")
    with socket.create_server(("127.0.0.1", 0)) as server, socket.socket(socket.AF_UNIX) as local:
        local.bind(str(redis))
        local.listen()
        yield {
            "secret": str(secret),
            "data": str(tmp_path / "data"),
            "port": str(server.getsockname()[1]),
            "redis": str(redis),
        }


#: Who attacks: the user of the tests, and one without powers.
USERS = (0, 65534) if os.geteuid() == 0 else (os.geteuid(),)
#: What only root may do in any case.
ROOTS = {"change the root", "name the machine", "mount", "become another user", "make a device"}
ROOTS |= {"give a file away", "bpf", "page faults"}


def outcomes(victims: dict[str, str], folder: Path, user: int, how: str) -> dict[str, str]:
    """What comes of each attack on another process of the same user."""
    program = shutil.copy(hostile_child.__file__, folder)
    scene = shutil.copytree(BOX, folder / "scenes" / "box" / "files")
    (folder / ".drjit").mkdir()
    for path in (folder, *folder.rglob("*")):
        os.chown(path, user, -1)
    for parent in folder.parents:
        if not parent.stat().st_mode & stat.S_IXOTH:
            parent.chmod(0o755)
    told = json.dumps({**victims, "scene": str(scene)})
    arguments = [sys.executable, program, told, str(user), how]
    environment = {**os.environ, "HOME": str(folder)}
    with subprocess.Popen(arguments, env=environment, stdin=PIPE, stdout=PIPE) as attacker:
        assert attacker.stdout is not None
        found: dict[str, str] = json.loads(attacker.stdout.read())
        attacker.communicate(b"\n")
    return found


@pytest.mark.parametrize("user", USERS)
def test_without_confinement_the_attacks_succeed(
    victims: dict[str, str], tmp_path: Path, user: int
) -> None:
    found = outcomes(victims, tmp_path, user, "free")
    refused = {name for name, how in found.items() if how in REFUSED}
    assert refused <= (ROOTS if user else set())


# On a GPU: without one CUDA does not start. Redis listens for streams, which they do not reach
@pytest.mark.parametrize(("how", "ways"), [("confined", set()), ("on a GPU", {"send packets"})])
@pytest.mark.parametrize("user", USERS)
def test_under_confinement_every_way_is_shut(
    victims: dict[str, str], tmp_path: Path, user: int, how: str, ways: set[str]
) -> None:
    found = outcomes(victims, tmp_path, user, how)
    assert {name: one for name, one in found.items() if one not in REFUSED}.keys() == ways


def test_a_child_that_was_taken_over_finds_every_way_shut(
    victims: dict[str, str], tmp_path: Path
) -> None:
    # Given a farm whose workers' render children run code of an attacker's
    attacker = tmp_path / "attacker"
    attacker.mkdir()
    search = os.pathsep.join([str(attacker), *filter(None, [os.environ.get("PYTHONPATH")])])
    with RealFarm(tmp_path / "farm", tmp_path / "cache") as farm:
        redis = farm.redis.url.partition("://")[2]
        hostile_child.take_over(attacker, {**victims, "redis": redis})
        farm.start("monitor")
        worker = farm.start("worker", PYTHONPATH=search)
        # When it is given a scene
        job = farm.submit(rule={"name": "fixed", "spp": 25})
        outcomes = tmp_path / "cache" / "home" / ".drjit" / "outcomes.json"
        until(outcomes.exists)
        until(lambda: farm.client.job(job.id).state is JobState.FAILED)
        # Then each attack was refused, and the worker is as it was
        found = json.loads(outcomes.read_text())
        assert {name: how for name, how in found.items() if how not in REFUSED} == {}
        assert worker.poll() is None
    assert (tmp_path / "data" / "credentials").read_text() == "swordfish"
    assert [one.name for one in (tmp_path / "data").iterdir()] == ["credentials"]


def test_doctor_says_what_holds_here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(variants, "_candidates", lambda: [(variants.SCALAR, None)])
    for name in ("PLATEAU_DATA", "PLATEAU_CACHE"):
        monkeypatch.setenv(name, str(tmp_path / name))
    doctor = CliRunner().invoke(app, ["doctor", "--json"])
    assert doctor.exit_code == 0
    checks = {one["name"]: one for one in json.loads(doctor.stdout)["checks"]}
    names = [f"a render child's {what}" for what in ("capabilities", "memory", "files")]
    assert all(checks[name]["ok"] for name in [*names, "a render child's system calls"])
    assert "Landlock, ABI" in checks["a render child's files"]["detail"]
