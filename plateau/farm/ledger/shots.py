"""Shots in Redis: where their frames stand, and what looks at them have said."""

import json
from dataclasses import dataclass
from typing import Final, get_args

from plateau.farm.ledger import records
from plateau.farm.ledger.ownership import Checkpoint
from plateau.farm.model.shot import (
    FrameAnswer,
    FrameOfShot,
    Shot,
    ShotByFrame,
    ShotFrame,
    ShotLook,
)
from plateau.farm.model.spec import JobSpec, stored_spec
from plateau.farm.model.states import JobState
from plateau.farm.redis import keys
from plateau.farm.redis.commands.shots import AnsweredFrame, AnswerFrames, Over
from plateau.farm.redis.scripts import OnRedis

_FIELDS: Final = (
    *("state", "spp", "width", "height", "finished_at"),
    *("shot", "shot_waits", "shot_answer", "checkpoint"),
)


@dataclass(frozen=True, kw_only=True)
class Frame:
    """A frame of a shot."""

    job_id: str
    state: JobState | None  #: None of one that is deleted
    spp: int
    in_shot: FrameOfShot | None
    checkpoint: Checkpoint | None
    film: tuple[int, int] | None  #: width and height in pixels
    is_finished: bool  #: whether its last results are written

    @property
    def is_waiting(self) -> bool:
        """Whether it waits for a look."""
        return self.in_shot is not None and self.in_shot.is_waiting and not self.has_ended

    @property
    def has_ended(self) -> bool:
        """Whether it has ended, or is deleted."""
        return self.state is None or self.state.ended

    @property
    def needs_spp(self) -> int | None:
        """What the last look has asked of it."""
        answer = None if self.in_shot is None else self.in_shot.answer
        return None if answer is None else answer.needs_spp

    @property
    def is_settled(self) -> bool:
        """Whether its image changes no more before the next look."""
        return self.is_waiting or self.is_finished or self.state is None


@dataclass(frozen=True, kw_only=True)
class ShotRecord:
    """A shot as Redis has it."""

    id: str
    spec: JobSpec | None  #: of its first frame that is not deleted
    frames: tuple[Frame, ...]
    looks: int
    last: ShotLook | None
    why: str
    over: Over | None


class Shots(OnRedis):
    """All shots. Every method raises `StoreUnavailable` when Redis is away."""

    def get(self, shot_id: str) -> ShotRecord | None:
        """Return the shot, or None where its first frame is deleted."""
        about = self._redis.hgetall(keys.job(shot_id, "shot"))
        if not about:
            return None
        looks = int(about["looks"])
        job_ids = json.loads(about["frames"])
        pipe = self._redis.pipeline(transaction=False)
        for job_id in job_ids:
            pipe.hmget(keys.job(job_id), _FIELDS)
        pipe.hget(keys.job(shot_id), "spec")
        *rows, spec = pipe.execute()
        last = about.get(f"look:{looks - 1}")
        return ShotRecord(
            id=shot_id,
            spec=None if spec is None else stored_spec(spec),
            frames=tuple(map(_frame, job_ids, rows)),
            looks=looks,
            last=None if last is None else ShotLook.model_validate_json(last),
            why=about.get("why", ""),
            over=next((one for one in get_args(Over) if one == about.get("over")), None),
        )

    def looks(self, shot_id: str) -> list[ShotLook]:
        """Return all looks at the shot, in order."""
        about = self._redis.hgetall(keys.job(shot_id, "shot"))
        return [
            ShotLook.model_validate_json(about[f"look:{number}"])
            for number in range(int(about.get("looks", 0)))
        ]

    def answer(
        self,
        record: ShotRecord,
        look: ShotLook | None,
        why: str,
        answers: dict[str, FrameAnswer | None],
        over: Over | None = None,
    ) -> None:
        """Note the next look at the shot, and what it says to frames, unless it is noted already.

        Without a look the shot could not be judged. A frame without an answer waits no more.
        """
        told = tuple(
            AnsweredFrame(job_id, "" if one is None else one.model_dump_json())
            for job_id, one in answers.items()
        )
        self._scripts.run(
            AnswerFrames(
                shot=record.id,
                number=record.looks,
                look=None if look is None else look.model_dump_json(),
                why=why,
                answers=told,
                over=over,
            )
        )


def summary(record: ShotRecord) -> Shot | None:
    """Return the shot as its users see it; None of one whose spec is gone."""
    if record.spec is None or record.spec.shot is None:
        return None
    last, frames = record.last, record.frames
    settled = sum(one.is_settled for one in frames)
    state = record.over
    if state is None and all(one.has_ended for one in frames):
        state = "not judged"
    return Shot(
        id=record.id,
        fps=record.spec.shot.fps,
        target=record.spec.shot.target,
        frames=len(frames),
        state=state or ("judging" if settled == len(frames) else "rendering"),
        why=record.why,
        waiting=settled,
        looks=record.looks,
        spp=None if last is None else sum(last.spp) / len(last.spp),
        jod=None if last is None else last.jod,
        low_jod=None if last is None else last.low_jod,
        low_moment_jod=None if last is None else min(last.low_frames),
        worst_frame=None if last is None else last.worst_frame,
    )


def by_frame(record: ShotRecord, looks: list[ShotLook]) -> ShotByFrame | None:
    """Return the shot frame by frame; None of one whose spec is gone."""
    shot = summary(record)
    if shot is None:
        return None
    frames = tuple(
        ShotFrame(
            job=one.job_id,
            state=one.state,
            spp=one.spp,
            waits=one.is_waiting,
            needs_spp=one.needs_spp,
        )
        for one in record.frames
    )
    return ShotByFrame(**dict(shot), by_frame=frames, judged=tuple(looks))


def _frame(job_id: str, values: list[str | None]) -> Frame:
    fields = dict(zip(_FIELDS, values, strict=True))
    state, checkpoint = fields["state"], fields["checkpoint"]
    width, height = fields["width"], fields["height"]
    return Frame(
        job_id=job_id,
        state=None if state is None else JobState(state),
        spp=int(fields["spp"] or 0),
        in_shot=records.frame_of_shot(fields),
        checkpoint=None if checkpoint is None else Checkpoint.model_validate_json(checkpoint),
        film=(int(width), int(height)) if width and height else None,
        is_finished=fields["finished_at"] is not None,
    )
