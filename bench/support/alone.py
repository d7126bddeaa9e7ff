"""Has one Mitsuba process render passes alone, as `bench.support.bare_mitsuba` does."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from farm.seeds import Pass

_ROOT = Path(__file__).parents[2]


def render_alone(
    scene: Path,
    parameters: Mapping[str, str],
    slices: Iterable[Sequence[Pass]],
    *,
    variant: str,
    llvm_library: str | None,
    threads: int,
    cache: Path,
    image: Path | None = None,
    environment: Mapping[str, str] = os.environ,
) -> dict[str, Any]:
    """Return what the process says: when it began to render, and when each pass ended.

    Parameters
    ----------
    scene
        A folder with a ``scene.xml``.
    parameters
        Values of its ``$parameters``.
    slices
        The passes of each slice, in order.
    variant, llvm_library, threads
        What Mitsuba runs with.
    cache
        The worker's, whose home has the kernels that Dr.Jit has compiled.
    image
        Where the image goes, as .npy; nowhere else.
    environment
        What the process has beside these.
    """
    request = {
        "variant": variant,
        "threads": threads,
        "folder": str(scene),
        "entry": "scene.xml",
        "parameters": dict(parameters),
        "passes": [(one.spp, one.seed) for passes in slices for one in passes],
        "image": None if image is None else str(image),
    }
    home = cache / "home"
    home.mkdir(parents=True, exist_ok=True)
    own = {"HOME": str(home)}
    if llvm_library is not None:
        own["DRJIT_LIBLLVM_PATH"] = llvm_library
    done = subprocess.run(
        [sys.executable, "-m", "bench.support.bare_mitsuba"],
        cwd=_ROOT,
        env={**environment, **own},
        input=json.dumps(request),
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    told: dict[str, Any] = json.loads(done.stdout)
    return told
