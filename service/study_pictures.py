"""The pictures of an observer study: a job's first slices merged, and the reference of all slices.

All are made alike, by the job's own exposure, so that nothing tells two of them apart but the
number of their samples.
"""

import threading
from collections.abc import Iterator
from typing import Final

import numpy as np

from farm import blobs
from farm.blobs import Blobs
from farm.errors import CannotStudy, CorruptPartial
from farm.exr import decode_partial
from farm.job import Job
from farm.jobs import Jobs
from farm.png import encode_png
from farm.records import prefix_length
from farm.study import MOST_LEVELS, MOST_PIXELS
from farm.study_order import Method
from metric import encode_srgb
from service.merge import Merge

#: The paper's levels, as shares of the reference's spp: 100, 500, …, 2500 of 10,000.
_CONSTANT: Final = tuple(one / 100 for one in range(1, 26, 4))
#: For the first stage: 0.5 % to 40 %, at equal ratios.
_LIMITS: Final = tuple(np.geomspace(0.005, 0.4, 12).tolist())

#: Merging takes a few hundred MB, so one process makes one study at a time.
_ONE_AT_A_TIME: Final = threading.Lock()


def kept_slices(jobs: Jobs, job: Job) -> list[str]:
    """The blobs of the job's slices from the first on, without a gap.

    Raises
    ------
    CannotStudy
        It has not ended, kept none, or its pictures would be too large to be shown.
    """
    if job.finished_at is None:
        raise CannotStudy(f"job {job.id} is {job.state.value}: a study is made from one that ended")
    if not job.spec.keep_slices:
        raise CannotStudy(f"job {job.id} did not keep its slices: submit with keep_slices")
    ledger = jobs.ledger(job.id)
    kept = [ledger[index]["blob"] for index in range(prefix_length(ledger))]
    if not kept or job.width is None or job.height is None:
        raise CannotStudy(f"job {job.id} has no slices")
    if job.width * job.height > MOST_PIXELS:
        raise CannotStudy(
            f"job {job.id} has {job.width}×{job.height} pixels: two pictures of more than "
            f"{MOST_PIXELS:,} pixels do not fit side by side on a screen"
        )
    return kept


def default_levels(method: Method, slice_spp: int, slices: int, reference_spp: int) -> list[int]:
    """Levels that suit most scenes: the paper's shares of the reference's spp, in whole slices.

    For the first stage from 0.5 % to 40 % at equal ratios. Levels beyond the slices are left out.
    """
    shares = _CONSTANT if method == "constant" else _LIMITS
    wanted = {max(1, round(share * reference_spp / slice_spp)) for share in shares}
    return [slice_spp * one for one in sorted(wanted) if one <= slices]


def check_levels(levels: list[int], slice_spp: int, slices: int) -> tuple[int, ...]:
    """The levels by rising spp, or `CannotStudy` where the slices have not all of them."""
    if not 2 <= len(levels) <= MOST_LEVELS or len(set(levels)) < len(levels):
        raise CannotStudy(f"a study has 2 to {MOST_LEVELS} different levels")
    for spp in levels:
        if spp % slice_spp or not slice_spp <= spp <= slices * slice_spp:
            raise CannotStudy(
                f"there is no image of {spp} spp: {slices} slices of {slice_spp} spp are kept"
            )
    return tuple(sorted(levels))


def put_pictures(
    store: Blobs,
    study_id: str,
    *,
    job: Job,
    slices: list[str],
    levels: tuple[int, ...],
    reference: list[str],
) -> None:
    """Merge the slices and put the pictures of a study.

    Parameters
    ----------
    store, study_id
        Where they go.
    job
        Whose exposure they all have, and whose slices the levels are made of.
    slices, reference
        Blobs of the slices of the job and of the reference, from the first on; the same where
        the job is its own reference.
    levels
        Spp of the test images, rising.

    Raises
    ------
    CannotStudy
        A slice is gone, spoiled or of another size.
    """
    places = {spp: blobs.study_level(study_id, spp) for spp in levels}
    same = slices == reference
    wanted = slices if same else slices[: levels[-1] // job.spec.slice_spp]
    with _ONE_AT_A_TIME:
        for merge in _merges(store, wanted, job.spec.slice_spp):
            if merge.spp in places:
                _put(store, places[merge.spp], merge, job)
        if not same:
            *_, merge = _merges(store, reference, slice_spp=1)  # one object that grows
        _put(store, blobs.study_reference(study_id), merge, job)


def _merges(store: Blobs, slices: list[str], slice_spp: int) -> Iterator[Merge]:
    """The sum of the slices so far, after each of them."""
    merge = Merge(slice_spp=slice_spp)
    for name in slices:
        try:
            merge.add(decode_partial(store.get(name)).pixels)
        except (FileNotFoundError, CorruptPartial, ValueError) as error:
            raise CannotStudy(f"slice {merge.slices} cannot be used: {error}") from error
        yield merge


def _put(store: Blobs, name: str, merge: Merge, job: Job) -> None:
    store.put(name, encode_png(encode_srgb(merge.image(), job.spec.view.exposure_ev)))
