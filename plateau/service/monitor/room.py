"""Whether a monitor has memory for a job's film: where it has none, the kernel would end it."""

from typing import Final

from plateau.farm.model.job import Job
from plateau.farm.process.memory import memory_bytes, memory_left

#: Bytes for each pixel of the job whose turn it is: by frame, what a quality adds, by zones, and
#: for each AOV of three channels.
_FRAME, _QUALITY, _ZONES, _AOV = 300, 110, 560, 24
_GLIMPSE: Final = 20  #: bytes that showing a first pass takes, for each of its blob


class NoRoom(MemoryError):
    """Other jobs have the memory that this one needs for its turn."""


def check_room(job: Job, *, has_sums: bool, is_alone: bool) -> None:
    """Raise `MemoryError` where there is no memory for the job's turn.

    It is `NoRoom` where there will be memory once other jobs have ended.
    """
    if job.width is None or job.height is None or not job.committed_spp:
        return
    bytes_of_one = _ZONES if job.spec.by_zones else _FRAME + _QUALITY * job.spec.by_quality
    bytes_of_one += _AOV * len(job.spec.aovs)
    needed = bytes_of_one * job.width * job.height // (1 + has_sums)  # half of it at most is held
    if needed > (left := memory_left()):
        lack = MemoryError if is_alone or needed > memory_bytes() else NoRoom
        raise lack(
            f"{job.width}×{job.height} pixels take {needed / 1e9:.1f} GB, and this monitor, which "
            f"may have {memory_bytes() / 1e9:.1f} GB, has {max(left, 0) / 1e9:.1f} GB left"
        )


def has_room_to_show(first_pass: bytes) -> bool:
    """Whether there is memory to show the first pass of a job's first slice."""
    return _GLIMPSE * len(first_pass) <= memory_left()
