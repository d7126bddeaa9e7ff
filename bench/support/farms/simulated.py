"""What simulated workers say of themselves, and of slices whose seeds are made up."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from plateau.farm.ledger.queue import SliceRecord

if TYPE_CHECKING:
    from collections.abc import Sequence

    from plateau.farm.ledger.queue import Lease


def about(
    worker: str,
    variants: Sequence[str],
    started_at: str,
    *,
    held: Lease | None = None,
    slices_done: int = 0,
) -> dict[str, object]:
    """Return what a worker's heartbeat says, as `plateau.farm.model.job.Worker` has it."""
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
    """Return the record of a slice that nobody rendered; its seeds are those of no other."""
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
