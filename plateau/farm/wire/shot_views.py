"""The API's view of a shot."""

from typing import Any, Final

from pydantic import ConfigDict, Field

from plateau.farm.model.shot import ShotByFrame
from plateau.farm.wire import examples
from plateau.farm.wire.batch_views import batch_path


def shot_path(batch: str) -> str:
    """The path of the newest shot of the batch."""
    return f"{batch_path(batch)}/shot"


def _links(batch: str) -> dict[str, str]:
    root = shot_path(batch)
    return {"self": root, "film": f"{root}/film.png", "flicker": f"{root}/flicker.png"}


SHOT: Final[dict[str, Any]] = {
    "id": examples.OTHER_ID,
    "fps": 24,
    "target": 9.5,
    "frames": 2,
    "state": "rendering",
    "why": "the shot is an estimated 9.31 JOD, and surely 9.14 at its worst moment; the target is "
    "9.5",
    "waiting": 1,
    "looks": 1,
    "spp": 1000,
    "jod": 9.31,
    "low_jod": 9.27,
    "low_moment_jod": 9.14,
    "worst_frame": 1,
    "by_frame": [
        {
            "job": examples.OTHER_ID,
            "state": "rendering",
            "spp": 800,
            "waits": True,
            "needs_spp": None,
        },
        {
            "job": examples.JOB_ID,
            "state": "rendering",
            "spp": 1400,
            "waits": False,
            "needs_spp": 2000,
        },
    ],
    "judged": [
        {
            "at": "2026-11-21T08:12:40.104Z",
            "spp": [800, 1200],
            "jod": 9.31,
            "low_jod": 9.27,
            "frames": [9.4, 9.2],
            "low_frames": [9.36, 9.14],
            "worst_frame": 1,
            "asked": [1],
            "seconds": 1.2,
            "flicker_sha256": "4f" * 32,
        }
    ],
    "links": _links("exposures"),
}


class ShotView(ShotByFrame):
    """A shot with the paths of what belongs to it."""

    model_config = ConfigDict(frozen=True, extra="ignore", json_schema_extra={"examples": [SHOT]})

    links: dict[str, str] = Field(
        description="paths of the film of its newest frames, and of the map of its noise"
    )


def shot_view(batch: str, shot: ShotByFrame) -> ShotView:
    """The shot of the batch as the API shows it."""
    return ShotView(**dict(shot), links=_links(batch))
