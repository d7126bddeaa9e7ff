"""The renders that the experiment needs, each made once by the farm.

For each scene these are a job of the whole cap that keeps its slices, and a reference of as many
samples from another seed. They stay in a folder, so that a stopped run can continue.
"""

from __future__ import annotations

import shutil
import sys
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bench.support.farms.plateau_render import render
from plateau import scenes

if TYPE_CHECKING:
    from pathlib import Path

    from bench.experiment.cases import Case

#: Spp of one slice, the smallest step at which a series can be judged.
SLICE_SPP = 50
_KINDS = ("series", "reference")


@dataclass(frozen=True)
class Size:
    """How large the experiment is."""

    pixels: int  #: across and down
    cap: int  #: spp of every series and every reference


@dataclass(frozen=True)
class Rendered:
    """The renders of one scene."""

    case: Case
    size: Size
    slices: Path  #: a folder that `plateau judge` can read
    reference: Path  #: an EXR

    @property
    def parameters(self) -> dict[str, str]:
        """Values of the scene's ``$parameters``."""
        return _parameters(self.case, self.size)


def rendered(case: Case, size: Size, data: Path, *, workers: int) -> Rendered:
    """Return the renders of a scene; make those that the folder does not have yet."""
    series, reference = (_render(case, size, data, kind, workers=workers) for kind in _KINDS)
    return Rendered(case, size, series / "slices", reference / "image.exr")


def longest(case: Case, pixels: int, data: Path) -> Size | None:
    """Return the size of a folder's longest renders of a scene with these pixels; None if none."""
    names = [f"{case.slug}-{pixels}-*-{kind}" for kind in _KINDS]
    series, reference = (
        {int(one.name.split("-")[-2]) for one in data.glob(name)} for name in names
    )
    both = series & reference
    return Size(pixels, max(both)) if both else None


def _parameters(case: Case, size: Size) -> dict[str, str]:
    pixels = str(size.pixels)
    return {"width": pixels, "height": pixels, "intensity": f"{case.intensity:g}"}


def _render(case: Case, size: Size, data: Path, kind: str, *, workers: int) -> Path:
    out = data / f"{case.slug}-{size.pixels}-{size.cap}-{kind}"
    if out.exists():
        return out
    unfinished = out.with_name(f"{out.name}.part")
    shutil.rmtree(unfinished, ignore_errors=True)
    options: dict[str, object] = {
        "--rule": "fixed",
        "--spp": size.cap,
        "--max-spp": size.cap,
        "--step": _step(size.cap),
        "--slice-spp": SLICE_SPP,
        "--seed": case.seeds[_KINDS.index(kind)],
        "--workers": workers,
    }
    if kind == "series":
        options["--keep-slices"] = True
    print(f"{case.name}: rendering its {kind}, {size.cap:,} spp", file=sys.stderr)
    started = time.monotonic()
    render(
        scenes.FOLDER / case.family,
        unfinished,
        parameters=_parameters(case, size),
        options=options,
    )
    print(f"{case.name}: took {time.monotonic() - started:.0f} s", file=sys.stderr)
    unfinished.rename(out)
    return out


def _step(cap: int) -> int:
    """Return a step that divides the cap: these jobs need no curve."""
    return next(step for step in (1000, 500, 100, SLICE_SPP) if cap % step == 0)
