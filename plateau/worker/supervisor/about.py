"""What a worker reports of itself with each heartbeat."""

import os
import socket
from datetime import datetime, timezone

from plateau.farm.ledger.queue import Lease
from plateau.farm.model import versions
from plateau.farm.model.slices.zones import pixels_of
from plateau.farm.process.settings import Settings
from plateau.worker.supervisor.machine import MachineUse
from plateau.worker.supervisor.uploader import Rendered


class About:
    """A worker, what it has done, and what is wrong with it.

    `variants` are those that it can render with, best first; `threads` counts its render threads.
    """

    def __init__(
        self,
        worker_id: str,
        settings: Settings,
        variants: tuple[str, ...],
        tags: tuple[str, ...],
        threads: int,
    ) -> None:
        self._fixed = {
            "id": worker_id,
            "host": socket.gethostname(),
            "pid": os.getpid(),
            "plateau": versions.plateau(),
            "variants": variants,
            "threads": threads,
            "pool": settings.pool,
            "tags": tags,
            "label": _label(),
            "started_at": datetime.now(timezone.utc).isoformat(),
        }
        self.machine = MachineUse(settings.cache)
        self._threads = threads
        self._render_s = 0.0
        self._slices_done = 0
        self._samples_per_s: float | None = None
        self._last_error: str | None = None
        self._failures = 0
        self.trouble: str | None = None  #: why it takes no work

    def failed(self, error: str) -> None:
        """Count an error; the last one since a slice was rendered is told."""
        self._last_error = error
        self._failures += 1

    def rendered(self, one: Rendered) -> None:
        """Count a slice, its cost and its rate; errors before it are forgotten."""
        self._slices_done += 1
        self._render_s += one.render_s
        self._last_error, self._failures = None, 0
        pixels = pixels_of(one.zones) if one.zones else one.scene.width * one.scene.height
        samples = pixels * one.lease.spp
        self._samples_per_s = samples / one.render_s

    def told(
        self, rendering: Lease | None, trouble: str | None, kinds: tuple[str, ...]
    ) -> dict[str, object]:
        """Return the fields of `plateau.farm.model.worker.Worker`, while this slice is rendered."""
        return {
            **self._fixed,
            "job": rendering.job_id if rendering else None,
            "slice": rendering.index if rendering else None,
            "slices_done": self._slices_done,
            "samples_per_s": self._samples_per_s,
            "core_hours": self._render_s * self._threads / 3600,
            "kinds": kinds,
            "machine": self.machine.now(),
            "last_error": self._last_error,
            "failures": self._failures,
            "trouble": trouble,
        }


def _label() -> str | None:
    """The task that Slurm has started the worker as."""
    job = os.environ.get("SLURM_ARRAY_JOB_ID") or os.environ.get("SLURM_JOB_ID")
    task = os.environ.get("SLURM_ARRAY_TASK_ID")
    return job and f"slurm:{job}{f'_{task}' if task else ''}"
