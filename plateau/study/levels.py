"""The slices of an observer study, and the levels of its pictures."""

from typing import Final

from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.records import prefix_length
from plateau.farm.model.job import Job
from plateau.study.model import MOST_LEVELS, MOST_PIXELS, CannotStudy, KeptSlice
from plateau.study.order import Method

#: The paper's levels, as shares of the reference's spp: 100, 500, …, 2500 of 10,000.
_CONSTANT: Final = tuple(one / 100 for one in range(1, 26, 4))
#: Those of the first stage: 0.5 % to 40 %, at equal ratios.
_LIMITS: Final = tuple(0.005 * 80 ** (one / 11) for one in range(12))


def kept_slices(jobs: Jobs, job: Job) -> list[KeptSlice]:
    """The job's slices from the first on, without a gap.

    Raises `CannotStudy` if the job has not ended, kept no slices, or is too large for a screen.
    """
    if job.finished_at is None:
        raise CannotStudy(
            f"job {job.id} is {job.state.value}; wait until it has ended, then make the study"
        )
    if not job.spec.keep_slices:
        raise CannotStudy(
            f"job {job.id} did not keep its slices; submit the scene again with keep_slices"
        )
    if job.spec.by_zones:
        raise CannotStudy(
            f"job {job.id} is allocated by zones, and a study compares whole frames; submit the "
            "scene again with the allocation frame"
        )
    ledger = jobs.ledger(job.id)
    records = [ledger[index] for index in range(prefix_length(ledger))]
    kept = [KeptSlice(record["blob"], record["sha256"]) for record in records]
    if not kept or job.width is None or job.height is None:
        raise CannotStudy(f"job {job.id} ended without a slice; choose a job that has an image")
    if job.width * job.height > MOST_PIXELS:
        raise CannotStudy(
            f"job {job.id} has {job.width}×{job.height} pixels, and pictures of more than "
            f"{MOST_PIXELS:,} do not fit side by side on a screen; render a smaller image"
        )
    return kept


def default_levels(method: Method, slice_spp: int, slices: int, reference_spp: int) -> list[int]:
    """Levels that suit most scenes: shares of the reference's spp, in existing whole slices."""
    shares = _CONSTANT if method == "constant" else _LIMITS
    wanted = {max(1, round(share * reference_spp / slice_spp)) for share in shares}
    return [slice_spp * one for one in sorted(wanted) if one <= slices]


def check_levels(levels: list[int], slice_spp: int, slices: int) -> tuple[int, ...]:
    """The levels by rising spp, or `CannotStudy` if the slices do not reach all of them."""
    possible = f"name multiples of {slice_spp} spp up to {slices * slice_spp:,}"
    if not 2 <= len(levels) <= MOST_LEVELS or len(set(levels)) < len(levels):
        raise CannotStudy(f"a study needs 2 to {MOST_LEVELS} different levels; {possible}")
    for spp in levels:
        if spp % slice_spp or not slice_spp <= spp <= slices * slice_spp:
            raise CannotStudy(f"there is no image of {spp} spp; {possible}")
    return tuple(sorted(levels))
