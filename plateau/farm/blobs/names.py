"""The names of the blobs in a store."""

import re
from typing import Final

#: The store's own blob: it names the Redis that the store belongs to.
MARK: Final = "plateau-store"

#: Prefixes of the names of scenes and of jobs' blobs.
SCENES: Final = "scenes/"
JOBS: Final = "jobs/"
_PARTIAL: Final = re.compile(rf"{JOBS}[0-9a-f]{{12}}/partials/[^/]+\.exr")


def scene(sha256: str) -> str:
    """The name of an uploaded scene, kept as it came."""
    return f"{SCENES}{sha256}"


def of_job(job_id: str) -> str:
    """The prefix of all blobs of a job."""
    return f"{JOBS}{job_id}/"


def in_job(name: str) -> tuple[str, str]:
    """The id of a blob's job, and the blob's name below the prefix of `of_job`."""
    job_id, _, rest = name.removeprefix(JOBS).partition("/")
    return job_id, rest


def partial(job_id: str, index: int, attempt: str) -> str:
    """The name of one attempt at a slice; the ledger says which attempt counts."""
    return f"{partials(job_id)}{index:06d}-{attempt}.exr"


def glimpse(job_id: str, attempt: str) -> str:
    """The name of the first pass of a job's first slice, kept until it is shown."""
    return f"{partials(job_id)}glimpse-{attempt}.exr"


def is_partial(name: str) -> bool:
    """Whether it is a name as `partial` and `glimpse` give it, of any job.

    A worker wrote the names in a ledger: no other blob may be read, shown or removed by them.
    """
    return _PARTIAL.fullmatch(name) is not None


def partials(job_id: str) -> str:
    """The prefix of a job's partials."""
    return f"{of_job(job_id)}partials/"


def checkpoints(job_id: str) -> str:
    """The prefix of a job's checkpoints."""
    return f"{of_job(job_id)}checkpoints/"


def results(job_id: str) -> str:
    """The prefix of a job's sets of results; `Jobs.results` says which set counts.

    A set is a folder with ``image.exr``, ``image.png``, ``thumbnail.png`` and, where there is
    something to show, ``difference``, ``noise``, ``quality``, ``spp`` and ``non-finite.png``.
    """
    return f"{of_job(job_id)}results/"


#: The end of the name of a job's last set: its EXR is compressed.
FINAL: Final = "-final"


def result_set(job_id: str, spp: int, token: str) -> str:
    """The folder of the results at `spp` of the monitor with this fencing token."""
    return f"{results(job_id)}{spp:07d}-{token}"


def spp_of_set(name: str) -> int | None:
    """The spp in the name that `result_set` gave; None of another name."""
    spp, dash, _ = name.rpartition("/")[2].partition("-")
    return int(spp) if dash else None


def previews(job_id: str) -> str:
    """The prefix of the previews that a job keeps of its course."""
    return f"{of_job(job_id)}previews/"


def preview(job_id: str, spp: int) -> str:
    """The name of the preview of the merged image at `spp` samples per pixel."""
    return f"{previews(job_id)}{spp:07d}.png"


def flicker_map(shot_id: str, look: int) -> str:
    """The name of the map of where a look has seen noise in the shot with this first frame."""
    return f"{of_job(shot_id)}shot/flicker-{look:04d}.png"


def spp_of_preview(name: str) -> int:
    """The spp in the name that `preview` gave."""
    return int(name.rpartition("/")[2].removesuffix(".png"))
