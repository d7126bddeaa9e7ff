"""What each request of a worker or a monitor costs Redis, and what a merge costs."""

from __future__ import annotations

import hashlib
import time
from typing import TYPE_CHECKING

import numpy as np

from bench.support.farms.scale_farm import SPEC, ControlPlane
from bench.support.farms.simulated import POINT, made_up_record
from plateau.farm.blobs.store import Blobs
from plateau.farm.images.exr import Partial, decode_partial, encode_partial
from plateau.farm.ledger.ownership import Ownership, Ownerships
from plateau.farm.ledger.queue import Lease, SliceQueue
from plateau.service.judging.merge import Merge

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

_VARIANTS = ("llvm_ad_rgb", "scalar_rgb")
_MERGES = 7


def costs(farm: ControlPlane, *, jobs: int, turns: int) -> dict[str, tuple[float, float]]:
    """Return the µs of Redis's CPU and the bytes of Redis's log for each request.

    The control plane has no monitors and no jobs; this many `jobs` wait during the measurement.
    Each request is made `turns` times.
    """
    owners, queue = Ownerships(farm.client, lease_s=600), SliceQueue(farm.client, "one", 600)
    owned: list[Ownership] = []
    for _ in range(jobs):
        job = farm.jobs.create(SPEC, name="box.zip", scene_sha256="0" * 64).job
        one = owners.acquire(job.id)
        if one is None:
            raise AssertionError("somebody owns a new job")
        owners.plan(one, range(turns))
        owned.append(one)
    leases: list[Lease] = []

    def lease(_: int) -> None:
        found = queue.lease(_VARIANTS, None, in_turn=False)
        if found is None:
            raise AssertionError("there is nothing to lease")
        leases.append(found)

    def commit(turn: int) -> None:
        blob = f"jobs/{leases[turn].job_id}/partials/{turn:06d}-one-1.exr"
        record = made_up_record(
            leases[turn], blob=blob, sha256="0" * 64, worker="one", render_s=1.0
        )
        queue.commit(leases[turn], record, width=16, height=16, notes=())

    first = owned[0]
    requests: dict[str, Callable[[int], object]] = {
        "lease a slice": lease,
        "heartbeat with one lease": lambda turn: queue.heartbeat({"id": "one"}, (leases[turn],)),
        "commit a slice": commit,
        "monitor: read a job": lambda _: farm.jobs.get(first.job_id),
        "monitor: plan": lambda turn: owners.plan(first, range(turns + turn + 1)),
        "monitor: read what is committed": lambda _: owners.committed(first.job_id, range(16)),
        "monitor: a point of the curve": lambda turn: owners.append_point(
            first, 100 * (turn + 1), POINT
        ),
    }
    return {name: _cost(farm, request, turns) for name, request in requests.items()}


def merge_costs(store: Blobs, sizes: Sequence[tuple[int, int]]) -> dict[str, tuple[float, float]]:
    """Return the CPU ms of one merge and a partial's bytes for each width and height.

    As in a monitor, the partial is fetched, checked, decoded and added.
    """
    found = {}
    for width, height in sizes:
        name, pixels = f"{width}×{height}", np.ones((height, width, 4), np.float32)
        made = Partial(
            job_id="one",
            index=0,
            first_seed=0,
            last_seed=2,
            spp=25,
            variant="llvm_ad_rgb",
            scene_sha256="0" * 64,
            pixels=pixels,
        )
        store.put(name, encode_partial(made))
        merge, spent, content = Merge(slice_spp=25), [], b""
        for _ in range(_MERGES):
            started = time.process_time()
            content = store.get(name)
            hashlib.sha256(content).hexdigest()
            merge.add(decode_partial(content).pixels)
            spent.append(time.process_time() - started)
        store.delete(name)
        found[name] = 1e3 * float(np.median(spent)), float(len(content))
    return found


def _cost(farm: ControlPlane, request: Callable[[int], object], turns: int) -> tuple[float, float]:
    before = farm.sample()
    for turn in range(turns):
        request(turn)
    spent = farm.sample().since(before)
    return 1e6 * spent.redis_cpu_s / turns, spent.log_bytes / turns
