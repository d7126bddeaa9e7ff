"""The system's libraries that the wheels need: what setup ensures is what they ask for."""

import os
import subprocess
import sys
from collections.abc import Iterator
from importlib.metadata import distributions
from pathlib import Path

import pytest
from elftools.elf.dynamic import DynamicSection
from elftools.elf.elffile import ELFFile

from plateau.worker.supervisor import needed_libraries

ROOT = Path(__file__).parents[3]

#: Part of the C library, as which each Python is linked with them.
C_LIBRARY = {
    *("libc.so.6", "libm.so.6", "libpthread.so.0", "libdl.so.2", "librt.so.1"),
    "libmvec.so.1",
    *("ld-linux-x86-64.so.2", "ld-linux-aarch64.so.1"),
}

#: Two of numba's three ways to run threads: it does without, and `metric` asks for no threads. And
#: Open Image Denoise's way to a GPU.
DONE_WITHOUT = {"libtbb.so.12", "libgomp.so.1", "libgomp.so.1.0.0", "libcuda.so.1"}

#: Files that are not opened: they are many, and no programs.
_TEXT = {".py", ".pyc", ".pyi", ".h", ".js", ".ts", ".json", ".txt", ".html", ".png", ".svg"}

linux_only = pytest.mark.skipif(sys.platform != "linux", reason="other names, and other linkers")


def _programs() -> Iterator[Path]:
    """Every file of an installed wheel that is a program or a library."""
    for wheel in distributions(path=[one for one in sys.path if one.startswith(sys.prefix)]):
        for listed in wheel.files or ():
            file = Path(str(listed.locate()))
            if file.suffix not in _TEXT and file.is_file():
                with file.open("rb") as content:
                    if content.read(4) == b"\x7fELF":
                        yield file


def _needed(program: Path) -> set[str]:
    """The sonames that a program is linked with."""
    with program.open("rb") as file:
        return {
            tag.needed
            for section in ELFFile(file).iter_sections()
            if isinstance(section, DynamicSection)
            for tag in section.iter_tags("DT_NEEDED")
        }


@linux_only
def test_what_wheels_need_of_the_system_is_what_setup_ensures() -> None:
    programs = list(_programs())
    assert len(programs) > 100  # Mitsuba alone has that many
    brought = {program.name for program in programs}
    of_the_system: dict[str, Path] = {
        soname: program for program in programs for soname in _needed(program) - brought
    }
    asked = of_the_system.keys() - C_LIBRARY - DONE_WITHOUT
    assert asked == needed_libraries.PACKAGES.keys(), of_the_system


@pytest.fixture
def without_libatomic(tmp_path: Path) -> dict[str, str]:
    """An environment in which libatomic cannot be loaded, as where it is not installed."""
    (tmp_path / "libatomic.so.1").touch()
    return {
        **os.environ,
        "LD_LIBRARY_PATH": str(tmp_path),
        "PLATEAU_DATA": str(tmp_path / "data"),
        "PLATEAU_CACHE": str(tmp_path / "cache"),
    }


def _run(environment: dict[str, str], *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        arguments, env=environment, cwd=ROOT, capture_output=True, text=True, check=False
    )


PLATEAU = (sys.executable, "-m", "plateau")


@linux_only
class TestWithoutLibatomic:
    def test_doctor_names_it_and_the_package(self, without_libatomic: dict[str, str]) -> None:
        told = _run(without_libatomic, *PLATEAU, "doctor")
        assert told.returncode == 1
        assert (
            "nothing renders here: libatomic.so.1 is missing on this machine, and Mitsuba cannot "
            "be loaded; install it (Debian, Ubuntu: apt install libatomic1)" in told.stdout
        )
        assert "NameError" not in told.stdout

    @pytest.mark.parametrize("command", ["render", "up"])
    def test_nothing_is_started_that_could_not_render(
        self, without_libatomic: dict[str, str], command: str, tmp_path: Path
    ) -> None:
        arguments = {"render": ("scenes:box", "-o", str(tmp_path / "out")), "up": ()}[command]
        told = _run(without_libatomic, *PLATEAU, command, *arguments)
        assert told.returncode == 1
        assert told.stderr.startswith("plateau: libatomic.so.1 is missing")
        assert told.stderr.count("\n") == 1

    def test_a_worker_says_so_and_ends(
        self, without_libatomic: dict[str, str], redis_url: str, tmp_path: Path
    ) -> None:
        farm = {"PLATEAU_REDIS_URL": redis_url, "PLATEAU_BLOBS": str(tmp_path / "blobs")}
        told = _run({**without_libatomic, **farm}, *PLATEAU, "worker")
        assert told.returncode == 1
        assert "libatomic.so.1 is missing" in told.stderr


@linux_only
class TestSetup:
    """It must not install anything while it is tested: apt-get and id are of the test's own."""

    @staticmethod
    def _set_up(environment: dict[str, str], folder: Path, user: int) -> tuple[str, str]:
        """What setup says, and what it asks of apt-get."""
        asked = folder / "asked"
        asked.touch()
        for name, line in (("apt-get", f'echo "$*" >> {asked}'), ("id", f"echo {user}")):
            (folder / name).write_text(f"#!/bin/sh\n{line}\n", encoding="utf-8")
            (folder / name).chmod(0o755)
        path = f"{folder}{os.pathsep}{os.environ['PATH']}"
        script = "set -euo pipefail; source deploy/lib.sh; find_libraries"
        told = _run({**environment, "PATH": path}, "bash", "-c", script)
        assert told.returncode == 0, told.stderr
        return told.stderr, asked.read_text(encoding="utf-8")

    def test_it_installs_what_is_missing_where_it_may(
        self, without_libatomic: dict[str, str], tmp_path: Path
    ) -> None:
        said, asked = self._set_up(without_libatomic, tmp_path, user=0)
        assert asked == "install -y -qq libatomic1\n"
        assert said == "setup: installing libatomic1 with apt-get\n"

    def test_it_says_what_is_missing_where_it_may_not(
        self, without_libatomic: dict[str, str], tmp_path: Path
    ) -> None:
        said, asked = self._set_up(without_libatomic, tmp_path, user=1000)
        assert asked == ""
        assert "apt install libatomic1" in said

    def test_it_does_nothing_where_nothing_is_missing(self, tmp_path: Path) -> None:
        assert self._set_up(dict(os.environ), tmp_path, user=0) == ("", "")


#: What each image of Debian has, because apt is linked with it.
OF_APT = {"libgcc-s1", "libstdc++6", "zlib1g"}


@pytest.mark.parametrize("file", ["deploy/containers/Containerfile", "deploy/README.md"])
def test_images_and_machines_of_a_farm_install_what_wheels_need(file: str) -> None:
    lines = (ROOT / file).read_text(encoding="utf-8").splitlines()
    installed = {word for line in lines if "libllvm" in line for word in line.split()}
    assert set(needed_libraries.PACKAGES.values()) - installed <= OF_APT
