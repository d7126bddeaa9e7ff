"""The monitor's side of the process that looks at a shot."""

import json
import time
from dataclasses import dataclass
from functools import partial
from typing import IO, Any, Final

import numpy as np
from numpy.typing import NDArray

from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.ownership import Checkpoint
from plateau.farm.model.errors import CorruptPartial
from plateau.farm.model.spec import JobSpec
from plateau.farm.process.child import write_part
from plateau.farm.process.helper import HelperProcess
from plateau.metric.cvvdp import mirrored
from plateau.picture.checkpoints import stored_sums
from plateau.picture.denoised import unpacked
from plateau.picture.denoising.process import PIXEL_S
from plateau.service.monitor.shots import child

#: Seconds that a look may take, and how many more for each pixel of each frame: some twenty times
#: what a core needs.
_DEADLINE_S: Final = (60.0, 1e-4)


class FrameLost(Exception):
    """The sums of a frame are lost, or damaged: they have to be made again."""

    def __init__(self, place: int, why: Exception) -> None:
        super().__init__(f"the sums of frame {place} are lost: {why}")
        self.place = place


@dataclass(frozen=True, kw_only=True)
class LookTask:
    """What is looked at."""

    spec: JobSpec
    width: int
    height: int
    spp: tuple[int, ...]
    checkpoints: tuple[Checkpoint, ...]


@dataclass(frozen=True, kw_only=True)
class Looked:
    """What is seen."""

    about: dict[str, Any]  #: jod, low_jod, frames, low_frames, worst_frame, needed
    heat: NDArray[np.float32]  #: where noise is seen, (height, width)
    seconds: float


class Looking:
    """Looks at one shot at a time, in a process of its own."""

    def __init__(self, store: Blobs) -> None:
        self._blobs = store
        self._process = HelperProcess(child.__name__)

    def close(self) -> None:
        """End the process, if one runs, and start no other."""
        self._process.close()

    def look(self, task: LookTask) -> Looked:
        """Look at the shot.

        Raises
        ------
        NoAnswer, FrameLost, BlobsUnavailable
            It could not be looked at.
        """
        assert task.spec.shot is not None
        started = time.monotonic()
        frames = len(task.spp)
        places = (*mirrored(task.spec.shot.fps, frames), *range(frames))
        first_s, pixel_s = _DEADLINE_S
        if task.spec.is_denoised:
            pixel_s += PIXEL_S
        limit_s = first_s + pixel_s * task.width * task.height * len(places)
        answer = self._process.ask(partial(self._write, task, places), limit_s)
        found = unpacked(answer)
        about = json.loads(str(found["about"]))
        return Looked(about=about, heat=found["heat"], seconds=time.monotonic() - started)

    def _write(self, task: LookTask, places: tuple[int, ...], stream: IO[bytes]) -> None:
        about = {
            "spec": task.spec.model_dump(mode="json"),
            "width": task.width,
            "spp": task.spp,
            "slices": [checkpoint.slices for checkpoint in task.checkpoints],
        }
        write_part(stream, json.dumps(about).encode())
        for place in places:
            try:
                sums = stored_sums(self._blobs, task.checkpoints[place])
            except (FileNotFoundError, CorruptPartial) as error:
                raise FrameLost(place, error) from error
            write_part(stream, sums)
