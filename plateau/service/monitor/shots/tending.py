"""When shots are looked at, and what a look says to the frames."""

import hashlib
import logging
import math
import time
from collections import Counter
from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Final

from plateau.farm.blobs import names as blobs
from plateau.farm.blobs.store import Blobs
from plateau.farm.images.png import encode_png
from plateau.farm.ledger.shots import ShotRecord, Shots
from plateau.farm.model.errors import BlobsUnavailable
from plateau.farm.model.job import utc_now
from plateau.farm.model.shot import FrameAnswer, ShotLook
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.states import MAX_TRIES, JobState
from plateau.farm.process.child import NoAnswer
from plateau.farm.redis.commands.shots import Over
from plateau.metric.pictures import SAMPLES_PALETTE, heat_map
from plateau.service.monitor.shots.process import FrameLost, Looked, Looking, LookTask

_LOG = logging.getLogger(__name__)

#: Seconds between two checks whether all frames of a shot wait, and how many more for each frame.
_CHECK_S: Final = (0.5, 0.005)
#: Seconds until a look that failed is repeated.
_AGAIN_S: Final = 5.0


@dataclass(frozen=True, kw_only=True)
class Said:
    """What a look says."""

    asked: Mapping[int, int]  #: frame → samples per pixel before which it is not to end
    over: Over | None  #: if all frames may end
    words: str


def said(spec: JobSpec, spp: tuple[int, ...], waiting: frozenset[int], looked: Looked) -> Said:
    """Return what a look says to the frames: a function of the images that were looked at.

    Parameters
    ----------
    spec
        Of the frames.
    spp
        Samples per pixel of each frame.
    waiting
        The frames that have not ended.
    looked
        What was seen.
    """
    assert spec.shot is not None
    target, low = spec.shot.target, min(looked.about["low_frames"])
    words = f"the shot is an estimated {looked.about['jod']:.2f} JOD"
    if target is None:
        return Said(asked={}, over="judged", words=words)
    words += f", and surely {low:.2f} at its worst moment"
    if low >= target:
        return Said(asked={}, over="good", words=f"{words}; the target of {target:g} is reached")
    words += f"; the target is {target:g}"
    asked = {
        place: min(_next_step(needed, has, spec.step), spec.max_spp)
        for place, (needed, has) in enumerate(zip(looked.about["needed"], spp, strict=True))
        if needed > has and has < spec.max_spp and place in waiting
    }
    if asked:
        return Said(asked=asked, over=None, words=words)
    worst = looked.about["worst_frame"]
    return Said(asked={}, over="short", words=f"{words}, and frame {worst} may have no more")


def _next_step(needed: float, has: int, step: int) -> int:
    return max(math.ceil(needed / step), has // step + 1) * step


class Tending:
    """Looks at the shots whose frames wait with this monitor.

    Of all monitors the one that owns a shot's first waiting frame looks at it. If that one dies,
    another takes the frame over and looks again: at the same images, with the same answer. A look
    that another monitor has noted meanwhile is discarded.
    """

    def __init__(self, shots: Shots, store: Blobs) -> None:
        self._shots = shots
        self._blobs = store
        self._looking = Looking(store)
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="shots")
        self._waiting: dict[str, str] = {}  # frame → shot
        self._due: dict[str, float] = {}  # shot → when to check it
        self._failures: Counter[str] = Counter()
        self._look: tuple[ShotRecord, LookTask, Future[Looked]] | None = None

    @property
    def is_busy(self) -> bool:
        """Whether a shot is being looked at."""
        return self._look is not None

    def add(self, job_id: str, shot_id: str) -> None:
        """Note that a frame waits."""
        self._waiting[job_id] = shot_id

    def remove(self, job_id: str) -> None:
        """Note that a frame waits no more, or with another monitor."""
        self._waiting.pop(job_id, None)

    def close(self) -> None:
        """End the look, if there is one."""
        self._looking.close()
        self._thread.shutdown(cancel_futures=True)

    def advance(self) -> None:
        """Note a look that is done, and begin those that are due."""
        if self._look is not None and self._look[2].done():
            record, task, future = self._look
            self._look = None
            self._conclude(record, task, future)
        now_s = time.monotonic()
        shots = dict.fromkeys(self._waiting.values())
        self._due = {shot_id: due for shot_id, due in self._due.items() if shot_id in shots}
        for shot_id in shots:
            if now_s >= self._due.get(shot_id, float("-inf")) and self._look is None:
                self._check(shot_id)

    def _check(self, shot_id: str) -> None:
        record = self._shots.get(shot_id)
        if record is None or record.spec is None or record.spec.shot is None:
            self._release_unknown(shot_id)
            return
        base_s, frame_s = _CHECK_S
        self._due[shot_id] = time.monotonic() + base_s + frame_s * len(record.frames)
        first = next((one for one in record.frames if one.is_waiting), None)
        if first is None or first.job_id not in self._waiting:
            return
        if not all(one.is_settled for one in record.frames):
            return
        missing = _missing(record)
        if missing is not None:
            self._release(record, f"the shot was not judged: {missing}")
            return
        task = _task(record)
        self._look = record, task, self._thread.submit(self._looking.look, task)

    def _conclude(self, record: ShotRecord, task: LookTask, future: "Future[Looked]") -> None:
        try:
            looked = future.result()
        except FrameLost as lost:
            _LOG.warning("%s", lost)
            frame = record.frames[lost.place]
            if frame.is_waiting:  # its monitor makes them again
                self._shots.answer(record, None, str(lost), {frame.job_id: None})
            else:
                self._release(record, f"the shot was not judged: {lost}")
            return
        except BlobsUnavailable as error:
            _LOG.warning("a shot waits to be judged: %s", error)
            self._put_off(record.id)
            return
        except NoAnswer as failed:
            self._failures[record.id] += 1
            _LOG.warning("a shot was not judged: %s", failed)
            if self._failures[record.id] >= MAX_TRIES:
                self._release(record, f"the shot was not judged: {failed}")
                del self._failures[record.id]
            self._put_off(record.id)
            return
        self._failures.pop(record.id, None)
        self._answer(record, task, looked)

    def _answer(self, record: ShotRecord, task: LookTask, looked: Looked) -> None:
        waiting = frozenset(place for place, frame in enumerate(record.frames) if frame.is_waiting)
        found = said(task.spec, task.spp, waiting, looked)
        picture = encode_png(
            heat_map(looked.heat, float(looked.heat.max()) or 1.0), SAMPLES_PALETTE
        )
        blob = blobs.flicker_map(record.id, record.looks)
        self._blobs.put(blob, picture)
        about = {name: one for name, one in looked.about.items() if name != "needed"}
        look = ShotLook(
            **about,
            at=utc_now(),
            spp=task.spp,
            asked=tuple(found.asked),
            seconds=round(looked.seconds, 3),
            flicker_sha256=hashlib.sha256(picture).hexdigest(),
        )
        self._shots.answer(record, look, found.words, _answers(record, task.spp, found), found.over)
        folder = f"{blob.rpartition('/')[0]}/"
        self._blobs.delete(*(name for name in self._blobs.names(folder) if name < blob))

    def _release(self, record: ShotRecord, why: str) -> None:
        """Let the frames end by their own rules."""
        found = Said(asked={}, over="not judged", words=why)
        spp = tuple(frame.spp for frame in record.frames)
        self._shots.answer(record, None, why, _answers(record, spp, found), found.over)

    def _release_unknown(self, shot_id: str) -> None:
        """Let this monitor's frames of a shot end whose first frame is deleted."""
        mine = tuple(job_id for job_id, shot in self._waiting.items() if shot == shot_id)
        why = "the shot was not judged: its first frame is deleted"
        answer = FrameAnswer(spp=0, needs_spp=None, good=True, words=why)
        gone = ShotRecord(
            id=shot_id, spec=None, frames=(), looks=0, last=None, why="", over="not judged"
        )
        self._shots.answer(gone, None, why, dict.fromkeys(mine, answer))

    def _put_off(self, shot_id: str) -> None:
        self._due[shot_id] = time.monotonic() + _AGAIN_S


def _answers(
    record: ShotRecord, spp: tuple[int, ...], found: Said
) -> dict[str, FrameAnswer | None]:
    """Return the answers to the frames that wait: those that are asked for more, or all."""
    return {
        frame.job_id: FrameAnswer(
            spp=spp[place],
            needs_spp=found.asked.get(place),
            good=found.over != "short",
            words=found.words,
        )
        for place, frame in enumerate(record.frames)
        if frame.is_waiting and (found.over is not None or place in found.asked)
    }


def _missing(record: ShotRecord) -> str | None:
    """Return what keeps the shot from being judged, in words."""
    for place, frame in enumerate(record.frames):
        name = f"frame {place}, job {frame.job_id},"
        if frame.state is None:
            return f"{name} is deleted"
        if frame.state is JobState.FAILED:
            return f"{name} has failed"
        if frame.checkpoint is None or frame.checkpoint.slices < 2:
            return f"{name} has ended as {frame.state} without sums of two slices"
        if frame.film != record.frames[0].film:
            return f"{name} has another size than frame 0"
    return None


def _task(record: ShotRecord) -> LookTask:
    assert record.spec is not None
    film = record.frames[0].film
    assert film is not None
    checkpoints = tuple(one.checkpoint for one in record.frames if one.checkpoint is not None)
    return LookTask(
        spec=record.spec,
        width=film[0],
        height=film[1],
        spp=tuple(one.slices * record.spec.slice_spp for one in checkpoints),
        checkpoints=checkpoints,
    )
