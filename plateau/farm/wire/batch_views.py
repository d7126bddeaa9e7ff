"""The API's views of batches."""

from typing import Any, Final
from urllib.parse import quote

from pydantic import BaseModel, ConfigDict, Field

from plateau.farm.model.batch import Batch, BatchLine, SteeredJob
from plateau.farm.wire import examples


def batch_path(name: str) -> str:
    """The path of the batch, with its name quoted."""
    return f"/v1/batches/{quote(name, safe='')}"


def _links(name: str) -> dict[str, str]:
    root = batch_path(name)
    parts = ("cancel", "pause", "resume", "restore", "shot")
    jobs = f"/v1/jobs?batch={quote(name, safe='')}"
    return {"self": root, "jobs": jobs, **{part: f"{root}/{part}" for part in parts}}


_NAME: Final = "exposures"
_LINKS: Final = _links(_NAME)

LINE: Final[dict[str, Any]] = {
    "name": _NAME,
    "jobs": 2,
    "states": {"converged": 1, "rendering": 1},
    "newest_at": "2026-11-21T08:12:05.104Z",
    "links": _LINKS,
}
BATCH: Final[dict[str, Any]] = {
    "name": _NAME,
    "jobs": 2,
    "job_ids": [examples.OTHER_ID, examples.JOB_ID],
    "states": {"converged": 1, "rendering": 1},
    "held": 0,
    "finished": 1,
    "spp": {"least": 400, "most": 1200, "mean": 800},
    "estimate_fraction": {"least": 0.00018, "most": 0.0014724731, "mean": 0.00082623655},
    "machine_s": 41.6,
    "samples_saved": 52_428_800,
    "created_at": "2026-11-21T08:12:05.104Z",
    "started_at": "2026-11-21T08:12:06.020Z",
    "ended_at": None,
    "forecast_end_at": "2026-11-21T08:13:10.500Z",
    "shot": None,
    "links": _LINKS,
}
STEERED: Final[dict[str, Any]] = {
    "name": _NAME,
    "done": 1,
    "jobs": [
        {"job": examples.OTHER_ID, "done": False, "state": "converged", "why_not": "it has ended"},
        {"job": examples.JOB_ID, "done": True, "state": "cancelled", "why_not": None},
    ],
}


class BatchView(Batch):
    """A batch with the paths of what belongs to it."""

    model_config = ConfigDict(frozen=True, extra="ignore", json_schema_extra={"examples": [BATCH]})

    links: dict[str, str] = Field(
        description="paths of the batch, its jobs, and the calls that control it"
    )


class BatchLineView(BatchLine):
    """A batch in a list of them, with the same paths."""

    model_config = ConfigDict(extra="ignore", json_schema_extra={"examples": [LINE]})

    links: dict[str, str] = Field(
        description="paths of the batch, its jobs, and the calls that control it"
    )


class BatchPage(BaseModel):
    """A page of batches, those with the newest jobs first."""

    model_config = ConfigDict(
        json_schema_extra={"examples": [{"batches": [LINE], "next_cursor": "42"}]}
    )

    batches: list[BatchLineView]
    next_cursor: str | None = Field(
        description="`cursor` of the next page; null when this is the last"
    )


class BatchSteered(BaseModel):
    """The result of a change to each job of a batch."""

    model_config = ConfigDict(extra="ignore", json_schema_extra={"examples": [STEERED]})

    name: str
    done: int = Field(description="for how many jobs it was done")
    jobs: list[SteeredJob] = Field(description="each job, in the order in which they were made")


def batch_view(batch: Batch) -> BatchView:
    """The batch as the API shows it."""
    return BatchView(**dict(batch), links=_links(batch.name))


def line_view(line: BatchLine) -> BatchLineView:
    """A batch in a list of them, as the API shows it."""
    return BatchLineView(**dict(line), links=_links(line.name))


def steered_view(name: str, steered: list[SteeredJob]) -> BatchSteered:
    """The results of steering, as the API shows them."""
    return BatchSteered(
        name=name,
        done=sum(one.done for one in steered),
        jobs=steered,
    )
