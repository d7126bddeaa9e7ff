"""The kinds of jobs of a soak, each of which has the same image whenever nothing is wrong."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from tests.support.farms.faulty_farm import BY_ZONES, SPEC

_SMALL: Final = {"width": 48, "height": 32}
_FIXED: Final = {"step": 50, "slice_spp": 5, "max_spp": 600, "rule": {"name": "fixed", "spp": 400}}


@dataclass(frozen=True, kw_only=True)
class Kind:
    """A job, or a batch where it has frames, and what its user does with it."""

    name: str
    spec: dict[str, Any]
    weight: int = 1  #: how often it comes, compared with others
    is_analytic: bool = True
    frames: tuple[dict[str, Any], ...] = ()  #: parameters of each, in a batch
    does: str = ""  #: what its user does: ``cancel`` it, or ``pause`` it and resume it
    has_notice: bool = False


KINDS: Final = (
    Kind(name="frame", spec=SPEC, is_analytic=False, weight=2),
    Kind(name="zones", spec=BY_ZONES, is_analytic=False, weight=2),
    Kind(
        name="denoised",
        is_analytic=False,
        spec={
            "parameters": {"width": 64, "height": 64},
            "denoise": {"name": "oidn"},
            "step": 40,
            "slice_spp": 10,
            "max_spp": 1200,
            "rule": {"name": "fixed", "spp": 240},
        },
    ),
    Kind(
        name="AOVs",
        is_analytic=False,
        spec={
            "parameters": {"width": 32, "height": 32},
            "aovs": ["albedo", "normal", "depth", "shape_id"],
            "step": 40,
            "slice_spp": 20,
            "max_spp": 400,
            "rule": {"name": "fixed", "spp": 240},
        },
    ),
    Kind(name="analytic", spec={**_FIXED, "parameters": _SMALL}, weight=4),
    Kind(
        name="analytic by zones",
        spec={
            **_FIXED,
            "parameters": {**_SMALL, "noise": "fireflies"},
            "allocation": {"name": "zones", "size": 16},
        },
    ),
    Kind(name="with a notice", spec={**_FIXED, "parameters": _SMALL}, has_notice=True, weight=2),
    Kind(name="paused and resumed", spec={**_FIXED, "parameters": _SMALL}, does="pause"),
    Kind(
        name="cancelled",
        spec={**_FIXED, "parameters": _SMALL, "rule": {"name": "fixed", "spp": 600}},
        does="cancel",
    ),
    Kind(
        name="batch",
        spec={**_FIXED, "parameters": _SMALL},
        frames=tuple({"level": level} for level in (0.3, 0.5, 0.7)),
    ),
    Kind(
        name="shot",
        spec={
            "shot": {"fps": 24, "target": 9.0},
            "rule": {"name": "fixed", "spp": 40},
            "step": 20,
            "slice_spp": 10,
            "max_spp": 400,
            "parameters": {"width": 32, "height": 32},
        },
        frames=tuple({"level": level} for level in (0.3, 0.5, 0.4, 0.3)),
    ),
)


def write_analytic(folder: Path) -> Path:
    """Write the analytic scene of these kinds; returns its file."""
    file = folder / "checks.json"
    file.write_text(json.dumps({"analytic": 1, "light": "texture", "level": 0.5}))
    return file
