"""What a job has cost and saved, and when it is likely to end, by the fields of its hash."""

from collections.abc import Mapping
from typing import Any

from plateau.farm.model.job import Again


def committed_spp(fields: Mapping[str, str | None], slice_spp: int) -> int:
    """The samples per pixel in the ledger: by zones their mean, rounded down."""
    samples, width, height = map(fields.get, ("committed_samples", "width", "height"))
    if samples and width and height:
        return int(samples) // (int(width) * int(height))
    return int(fields["committed"] or 0) * slice_spp


def kept_spp(fields: Mapping[str, str | None]) -> int:
    """The samples per pixel that the job has of the one that it renders again."""
    again = fields.get("again")
    return Again.model_validate_json(again).kept_spp if again else 0


def core_hours(fields: Mapping[str, str | None]) -> float:
    """The job's core hours."""
    core_ms = int(fields["machine_ms"] or 0) + int(fields.get("further_core_ms") or 0)
    return round(core_ms / 3_600_000, 9)


def saved_core_hours(fields: Mapping[str, str | None], slice_spp: int) -> float:
    """What the saved samples would have cost, had each cost what the job's own did."""
    rendered_spp = committed_spp(fields, slice_spp) - kept_spp(fields)
    samples = rendered_spp * int(fields.get("width") or 0) * int(fields.get("height") or 0)
    saved = int(fields.get("samples_saved") or 0)
    return round(core_hours(fields) * saved / samples, 9) if samples > 0 else 0.0


def seconds_to(spp: int | None, latest: dict[str, Any], fields: Mapping[str, str]) -> float | None:
    """Seconds from the last point to so many spp, at the job's mean rate; None if unknown."""
    if spp is None or "started_at" not in fields:
        return None
    paused_ms = int(fields.get("latest_paused_ms", 0))  # before the last point
    rendering_ms = float(fields["latest_at"]) - float(fields["started_at"]) - paused_ms
    rendered = latest["spp"] - kept_spp(fields)
    if rendered <= 0:  # the points are of what it has of another job
        return None
    spp_per_ms = rendered / max(1.0, rendering_ms)
    seconds: float = max(0, spp - latest["spp"]) / spp_per_ms / 1000
    return seconds
