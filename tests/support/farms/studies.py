"""Jobs that kept their slices, and observers whose thresholds are known."""

import hashlib
import math
from typing import Final

from plateau.farm.ledger.ownership import Ownerships
from plateau.farm.model.job import Job
from plateau.farm.model.states import JobState
from plateau.picture.judge import Judge
from plateau.picture.merge import Merge
from plateau.service.monitor.result_sets import ResultSets
from tests.support.farms.ledger_farm import own
from tests.support.farms.noise_farm import NoiseFarm, noise_film

SCREEN: Final = {"viewing_distance_cm": 60.0, "pixel_pitch_mm": 0.25}


def ended_job(
    farm: NoiseFarm,
    *,
    slices: int,
    slice_spp: int,
    film_from: int = 0,
    name: str = "noise",
    **spec: object,
) -> Job:
    """A job that has converged and kept its slices; the test plays its monitor.

    `film_from` is the number of its first slice's noise, so that two jobs can have other samples.
    """
    spp = slices * slice_spp
    given = {"step": spp, "slice_spp": slice_spp, "max_spp": spp, "keep_slices": True}
    job = farm.submit(name, **{**given, **spec})
    owners = Ownerships(farm.jobs._redis, lease_s=600)
    owned = own(owners, job.id)
    owners.plan(owned, range(slices))
    merge = Merge(slice_spp=slice_spp)
    for _ in range(slices):
        lease = farm.lease()
        assert lease is not None
        assert lease.job_id == job.id
        film = noise_film(film_from + lease.index, slice_spp, farm.sigma)
        farm.commit(lease, film)
        merge.add(film)
    owners.end(owned, JobState.CONVERGED, "rule", "levelled off", {})
    results, sha256 = ResultSets(owned, owners, farm.store, job.spec).write(
        job, merge, Judge(job.spec), state=JobState.CONVERGED, reason="levelled off"
    )
    owners.conclude(owned, spp=spp, results=results, sha256=sha256, notes=())
    owners.finish(owned, keeps_sums=False)
    return farm.jobs.get(job.id)


def sees(observer: str, spp: int, side: str, *, threshold: float, spread: float) -> bool:
    """What a simulated observer answers: yes with probability 1 / (1 + e^((spp-threshold)/spread)).

    The dice are the observer's name and the pair (its spp, and the reference's side), so that a run
    is like any other, whatever the order is.
    """
    drawn = hashlib.sha256(f"{observer}:{spp}:{side}".encode()).digest()
    dice = int.from_bytes(drawn[:8], "big") / 2**64
    return dice < 1 / (1 + math.exp((spp - threshold) / spread))
