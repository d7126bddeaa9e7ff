"""The pictures of an observer study: a job's first slices merged, and the reference of all slices.

All have the job's exposure, so that they differ only by the number of their samples.
"""

import hashlib
from collections.abc import Iterator
from contextlib import suppress

from plateau.farm.blobs.store import Blobs
from plateau.farm.images.png import encode_png
from plateau.farm.model.errors import CorruptPartial
from plateau.farm.model.job import Job
from plateau.metric import encode_srgb
from plateau.picture.films import checked_partial
from plateau.picture.independence import Independence, NotIndependent
from plateau.picture.merge import Merge
from plateau.study.ledger import study_level, study_reference
from plateau.study.model import CannotStudy, KeptSlice


def put_pictures(
    store: Blobs,
    study_id: str,
    *,
    job: Job,
    slices: list[KeptSlice],
    levels: tuple[int, ...],
    reference: list[KeptSlice],
) -> dict[str, str]:
    """Merge the slices and put the pictures of a study; returns the SHA-256 of each by its blob.

    The job's `slices` make the test images at these `levels`, in rising spp; they equal those of
    the `reference` if the job is its own. Raises `CannotStudy` for a slice gone, damaged or odd.
    """
    places = {spp: study_level(study_id, spp) for spp in levels}
    same = slices == reference
    wanted = slices if same else slices[: levels[-1] // job.spec.slice_spp]
    digests = {}
    for merge in _merges(store, wanted, Merge.of(job.spec)):
        if merge.spp in places:
            digests[places[merge.spp]] = _put(store, places[merge.spp], merge, job)
    if not same:
        *_, merge = _merges(store, reference, Merge.of(job.spec))
    place = study_reference(study_id)
    digests[place] = _put(store, place, merge, job)
    return digests


def are_independent(
    store: Blobs, job: Job, slices: list[KeptSlice], other: Job, reference: list[KeptSlice]
) -> bool:
    """Whether two jobs have samples of their own, as their seeds and their first slices tell."""
    found = Independence()
    with suppress(NotIndependent):
        for one, kept in ((job, slices), (other, reference)):
            merge = next(_merges(store, kept[:1], Merge.of(one.spec)))
            found.add(one.id, merge.image(), one.id)
        return other.spec.seed != job.spec.seed
    return False


def _merges(store: Blobs, slices: list[KeptSlice], merge: Merge) -> Iterator[Merge]:
    """Yield the sum after each slice: `merge`, which begins empty and grows."""
    for kept in slices:
        try:
            merge.add_partial(checked_partial(store, kept.blob, kept.sha256))
        except (FileNotFoundError, CorruptPartial, ValueError) as error:
            raise CannotStudy(
                f"slice {merge.slices} is lost or damaged ({error}); render the scene again with "
                "keep_slices"
            ) from error
        yield merge


def _put(store: Blobs, name: str, merge: Merge, job: Job) -> str:
    content = encode_png(encode_srgb(merge.image(), job.spec.view.exposure_ev))
    store.put(name, content)
    return hashlib.sha256(content).hexdigest()
