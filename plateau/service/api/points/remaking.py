"""Restores damaged or lost results of finished jobs, from sums or from kept slices."""

import hashlib
import logging
from typing import TYPE_CHECKING, Any, Final

from numpy.typing import NDArray

from plateau.farm.blobs import names as blobs
from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.model.errors import CorruptPartial, JobNotFound
from plateau.farm.model.job import Job
from plateau.picture.checkpoints import read_sums
from plateau.picture.facts import FILE, decode_facts
from plateau.picture.films import checked_partial
from plateau.picture.merge import Merge
from plateau.picture.result_files import NoiseMaps, result_files
from plateau.rules import CURVE

if TYPE_CHECKING:
    from plateau.picture.judge import Judge

_LOG = logging.getLogger(__name__)

#: The most values of a film that is merged for this; one of 2560 × 1440 pixels takes 0.6 GB.
MOST_VALUES: Final = 2560 * 1440 * 4

_OF_NOISE: Final = ("noise.png", "quality.png")

_Memory = tuple[dict[str, Any], dict[str, NDArray[Any]]]


def remade(blob: str, sha256: str, jobs: Jobs, store: Blobs) -> bytes | None:
    """Make a result of a finished job again, to the byte; None if that is impossible."""
    job_id, name = blobs.in_job(blob)
    if not blob.startswith(blobs.results(job_id)):
        return None
    folder, _, picture = blob.rpartition("/")
    spp = blobs.spp_of_set(folder)
    try:
        job = jobs.get(job_id)
        values = (job.width or 0) * (job.height or 0) * job.spec.film_values
        if job.spec.is_denoised:  # this process has no denoiser
            return None
        if job.finished_at is None or not spp or not 0 < values <= MOST_VALUES:
            return None
        facts = decode_facts(store.get(f"{folder}/{FILE}"))
        merge, memory = _merged(job, spp, jobs, store)
    except (JobNotFound, FileNotFoundError, CorruptPartial, LookupError, ValueError) as error:
        _LOG.warning("%s cannot be made again: %s", name, error)
        return None
    files = result_files(
        merge,
        _judge(job, memory).visible_map(merge) if picture == "difference.png" else None,
        _judge(job, memory).noise_maps(merge) if picture in _OF_NOISE else NoiseMaps(),
        facts,
        job.spec,
        compressed=folder.endswith(blobs.FINAL),
    )
    content = files.get(picture, b"")
    return content if hashlib.sha256(content).hexdigest() == sha256 else None


def _merged(job: Job, spp: int, jobs: Jobs, store: Blobs) -> tuple[Merge, _Memory]:
    """The sum of the job's slices up to `spp`, and the memory of its rules of the first image."""
    plan = jobs.plan(job)
    if not job.spec.keep_slices:
        checkpoint = jobs.checkpoint(job.id)
        if checkpoint is None or plan.spp(checkpoint.slices) != spp:
            raise LookupError(f"no sums of {spp} spp are kept")
        return read_sums(store, checkpoint, job.spec)
    ledger, merge = jobs.ledger(job.id), Merge.of(job.spec)
    memory: _Memory = ({}, {})
    for index in range(plan.slices_of(spp)):
        merge.add_partial(checked_partial(store, ledger[index]["blob"], ledger[index]["sha256"]))
        if plan.is_point(merge.slices) and not memory[0]:
            numbers = {"first_spp": merge.spp, "points": []}
            memory = ({CURVE: numbers}, {f"{CURVE}:first": merge.image()})
    return merge, memory


def _judge(job: Job, memory: _Memory) -> "Judge":
    """The job's judge, who remembers its first image."""
    # Imported here, because it loads the compiled metric, which the API needs for nothing else.
    from plateau.picture.judge import Judge

    judge = Judge(job.spec)
    judge.recall(*memory)
    return judge
