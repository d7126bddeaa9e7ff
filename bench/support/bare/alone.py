"""Has one Mitsuba process render passes alone, as `bench.support.bare.mitsuba` does."""

from __future__ import annotations

import json
import os
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import psutil

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from plateau.farm.model.seeds import Pass

_ROOT = Path(__file__).parents[3]


@dataclass(frozen=True, kw_only=True)
class Alone:
    """What one Mitsuba process is to render."""

    #: A folder with a ``scene.xml``.
    scene: Path
    #: Values of its ``$parameters``.
    parameters: Mapping[str, str]
    #: The passes of each slice, in order.
    slices: Iterable[Sequence[Pass]]
    #: What Mitsuba runs with.
    variant: str
    llvm_library: str | None
    threads: int
    #: The worker's, whose home has the kernels that Dr.Jit has compiled.
    cache: Path
    #: Where the image goes, as .npy; nowhere else.
    image: Path | None = None
    #: What the process has beside these.
    environment: Mapping[str, str] = field(default_factory=lambda: os.environ)

    def render(self) -> dict[str, Any]:
        """Return what the process says: when it began to render, and when each pass ended.

        Raises
        ------
        ChildProcessError
            It failed; why is on standard error.
        """
        with tempfile.TemporaryFile() as told:
            process = self.start(told)
            if process.wait():
                raise ChildProcessError(f"Mitsuba alone: exit code {process.returncode}")
            return read_told(told)

    def start(self, told: IO[bytes]) -> psutil.Popen:
        """Start the process; what it says, for `read_told`, goes into the file."""
        request = {
            "variant": self.variant,
            "threads": self.threads,
            "folder": str(self.scene),
            "entry": "scene.xml",
            "parameters": dict(self.parameters),
            "passes": [(one.spp, one.seed) for passes in self.slices for one in passes],
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
            return psutil.Popen(
                [sys.executable, "-m", "bench.support.bare.mitsuba"],
                cwd=_ROOT,
                env={**self.environment, **own},
                stdin=asked,
                stdout=told,
            )


def read_told(told: IO[bytes]) -> dict[str, Any]:
    """Return what a process that has ended said."""
    told.seek(0)
    answer: dict[str, Any] = json.load(told)
    return answer
