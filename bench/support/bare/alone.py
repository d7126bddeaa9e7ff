"""Starts one Mitsuba process that renders passes alone: `bench.support.bare.mitsuba`."""

from __future__ import annotations

import json
import os
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import psutil

from bench import ROOT

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from plateau.farm.model.seeds import Pass


@dataclass(frozen=True, kw_only=True)
class Alone:
    """The work of one Mitsuba process."""

    scene: Path  #: a folder with a ``scene.xml``
    parameters: Mapping[str, str]  #: of the scene
    passes: Iterable[Pass]
    variant: str
    llvm_library: str | None
    threads: int
    cache: Path  #: the worker's; its home has the kernels that Dr.Jit has compiled
    nice: int = 0  #: its priority beside other work on the cores
    image: Path | None = None  #: an .npy file for the image, which is otherwise dropped
    environment: Mapping[str, str] = field(default_factory=lambda: os.environ)

    def render(self) -> dict[str, Any]:
        """Return what `bench.support.bare.mitsuba` answers.

        Raises
        ------
        ChildProcessError
            It failed; the reason is on standard error.
        """
        with tempfile.TemporaryFile() as told:
            process = self.start(told)
            if process.wait():
                raise ChildProcessError(f"Mitsuba alone: exit code {process.returncode}")
            return read_told(told)

    def start(self, told: IO[bytes]) -> psutil.Popen:
        """Start the process; it writes its answer, for `read_told`, into the file."""
        request = {
            "variant": self.variant,
            "threads": self.threads,
            "folder": str(self.scene),
            "entry": "scene.xml",
            "parameters": dict(self.parameters),
            "passes": list(self.passes),
            "image": None if self.image is None else str(self.image),
        }
        home = self.cache / "home"
        home.mkdir(parents=True, exist_ok=True)
        own = {"HOME": str(home)}
        if self.llvm_library is not None:
            own["DRJIT_LIBLLVM_PATH"] = self.llvm_library
        with tempfile.TemporaryFile() as asked:
            asked.write(json.dumps(request).encode())
            asked.seek(0)
            process = psutil.Popen(
                [sys.executable, "-m", "bench.support.bare.mitsuba"],
                cwd=ROOT,
                env={**self.environment, **own},
                stdin=asked,
                stdout=told,
            )
        process.nice(self.nice)  # long before its first thread renders
        return process


def read_told(told: IO[bytes]) -> dict[str, Any]:
    """Return the answer of a process that has ended."""
    told.seek(0)
    answer: dict[str, Any] = json.load(told)
    return answer
