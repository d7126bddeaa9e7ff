"""What a worker says of itself with each heartbeat."""

import os
import socket
from datetime import datetime, timezone

from plateau.farm.ledger.queue import Lease
from plateau.farm.model import versions
from plateau.farm.process.settings import Settings
from plateau.worker.supervisor.uploader import Rendered


class About:
    """A worker, what it has done, and what ails it.

    Parameters
    ----------
    worker_id
        Its id in the farm.
    settings
        Its pool, its tags and its label.
    variants
        What it can render with, best first.
    threads
        How many of them render.
    """

    def __init__(
        self, worker_id: str, settings: Settings, variants: tuple[str, ...], threads: int
    ) -> None:
        self._fixed = {
            "id": worker_id,
            "host": socket.gethostname(),
            "pid": os.getpid(),
            "plateau": versions.plateau(),
            "variants": variants,
            "threads": threads,
            "pool": settings.pool,
            "tags": settings.tags,
            "label": settings.label,
            "started_at": datetime.now(timezone.utc).isoformat(),
        }
        self._slices_done = 0
        self._samples_per_s: float | None = None
        self.last_error: str | None = None  #: what went wrong since it last rendered a slice
        self.trouble: str | None = None  #: why it takes no work

    def rendered(self, one: Rendered) -> None:
        """Count a slice, and its rate; what went wrong before is over."""
        self._slices_done += 1
        self.last_error = None
        samples = one.scene.width * one.scene.height * one.lease.spec.slice_spp
        self._samples_per_s = samples / one.render_s

    def told(self, rendering: Lease | None) -> dict[str, object]:
        """Return it as `plateau.farm.model.job.Worker` has it, while this slice is rendered."""
        return {
            **self._fixed,
            "job": rendering.job_id if rendering else None,
            "slice": rendering.index if rendering else None,
            "slices_done": self._slices_done,
            "samples_per_s": self._samples_per_s,
            "last_error": self.last_error,
            "trouble": self.trouble,
        }
