"""What simulated workers report of themselves and commit: partials, records, curve points."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from plateau.farm.bundle.analytic import AnalyticScene
from plateau.farm.images.exr import Partial, encode_partial
from plateau.farm.ledger.queue import SliceRecord
from plateau.worker.renderers.analytic.picture import Picture

if TYPE_CHECKING:
    from collections.abc import Sequence

    from plateau.farm.ledger.queue import Lease

#: A point of the curve, as large as most.
POINT: dict[str, object] = {
    "spp": 100,
    "visible_pixels": 40123,
    "visible_fraction": 0.612,
    "slope": -1.25,
    "estimate_pixels": 812.5,
    "estimate_fraction": 0.0124,
    "estimate_low_pixels": 700.25,
    "estimate_high_pixels": 930.75,
    "forecast_spp": 1900,
    "forecast_low_spp": 1700,
    "forecast_high_spp": 2300,
    "non_finite_pixels": 0,
    "zones": None,
    "rules": {"visible": {"value": 0.0124, "stop": False}},
}


def about(
    worker: str,
    variants: Sequence[str],
    started_at: str,
    *,
    held: Lease | None = None,
    slices_done: int = 0,
) -> dict[str, object]:
    """Return the fields of a heartbeat, those of `plateau.farm.model.job.Worker`."""
    return {
        "id": worker,
        "host": "simulated",
        "pid": os.getpid(),
        "variants": tuple(variants),
        "threads": 1,
        "job": held.job_id if held else None,
        "slice": held.index if held else None,
        "slices_done": slices_done,
        "samples_per_s": None,
        "last_error": None,
        "trouble": None,
        "started_at": started_at,
    }


def made_up_record(
    lease: Lease, *, blob: str, sha256: str, worker: str, render_s: float
) -> SliceRecord:
    """Return the record of a slice that nobody rendered; no other has its seeds."""
    return SliceRecord(
        index=lease.index,
        spp=lease.spec.slice_spp,
        first_seed=10 * lease.index,
        last_seed=10 * lease.index + 2,
        blob=blob,
        sha256=sha256,
        worker=worker,
        render_s=render_s,
    )


def made_up_partial(
    *, width: int, height: int, spp: int, variant: str, job_id: str = "simulated", index: int = 0
) -> bytes:
    """Return the EXR of a partial of grey noise."""
    picture = Picture(AnalyticScene(width=width, height=height, light="grey"))
    return encode_partial(
        Partial(
            job_id=job_id,
            index=index,
            first_seed=10 * index,
            last_seed=10 * index + 2,
            spp=spp,
            variant=variant,
            scene_sha256="0" * 64,
            pixels=picture.film(spp, seed=index),
        )
    )
