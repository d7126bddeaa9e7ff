"""Converts between Redis's fields and the records of `plateau.farm.model.job`."""

import json
import logging
import re
import secrets
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from itertools import chain, count
from typing import Any, Final

from plateau.farm.blobs import names as blobs
from plateau.farm.ledger import costs
from plateau.farm.model import fit
from plateau.farm.model.errors import UnreadableJob
from plateau.farm.model.job import Again, CurvePoint, Event, Job, Notice, moment
from plateau.farm.model.renderers import AUTO
from plateau.farm.model.shot import FrameAnswer, FrameOfShot, FrameWait
from plateau.farm.model.spec import JobSpec, stored_spec
from plateau.farm.model.spec.notice import NoticeSpec
from plateau.farm.model.spec.whole_slices import fitted
from plateau.farm.model.states import EndedBy, JobState, outcome
from plateau.farm.model.worker import Worker
from plateau.farm.redis import keys
from plateau.farm.redis.client import Pipeline, RedisClient
from plateau.farm.redis.commands.jobs import NewJob

_LOG = logging.getLogger(__name__)

#: What is raised by reading whatever a hostile worker, or one of another version, has written.
_NONSENSE: Final = (
    *(ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError),
)
_LEFT_OUT: Final = re.compile(r"([0-9a-f]{12}) (\d+)")


def fields_of(
    client: RedisClient, job_ids: Iterable[str], names: Sequence[str], part: str = ""
) -> list[dict[str, Any]]:
    """These fields of each job, None for those that it lacks, as text; in one round trip."""
    pipe = client.pipeline(transaction=False)
    for job_id in job_ids:
        pipe.hmget(keys.job(job_id, part), names)
    return [dict(zip(names, values, strict=True)) for values in pipe.execute()]


def curve_point(text: str, at: str) -> CurvePoint:
    """A point as `append_point` stored it."""
    return CurvePoint.model_validate({**json.loads(text), "at": moment(at)})


def event(event_id: str, fields: dict[str, str]) -> Event:
    """An event as `Outbox.announce` stored it."""
    data = json.loads(fields["data"])
    if fields["type"] == "point":
        data = curve_point(fields["data"], fields["at"]).model_dump(mode="json")
    return Event(id=event_id, type=fields["type"], data=data, at=moment(fields["at"]))


def slice_record(text: str) -> dict[str, Any]:
    """A slice's record as `commit` stored it, with the time of the commit (``at``, in ms)."""
    stored = json.loads(text)
    return {**json.loads(stored["record"]), "at": float(stored["at"])}


def ledger(records: dict[str, str]) -> dict[int, dict[str, Any]]:
    """Each slice's record by index, in order."""
    return {int(index): slice_record(records[index]) for index in sorted(records, key=int)}


def worker(fields: dict[str, str], now_ms: float) -> Worker | None:
    """A worker as its last heartbeat described it; None if it has gone, or said nonsense."""
    with suppress(*_NONSENSE):
        known = {
            **json.loads(fields["about"]),
            "drained": "drained" in fields,
            "left_out_of": left_out_of(fields, now_ms),
            "seen_at": moment(fields["seen_at"]),
        }
        return Worker.model_validate(known)
    return None


def left_out_of(fields: Mapping[str, str], now_ms: float) -> tuple[str, ...]:
    """The jobs of which the worker of these fields gets no slice for a while."""
    noted = _LEFT_OUT.findall(fields.get("left_out", "")[:65536])  # as the script reads it
    return tuple(job for job, until in noted if float(until) > now_ms)


def prefix_length(indices: Container[int]) -> int:
    """The number of indices from 0 on without a gap."""
    return next(index for index in count() if index not in indices)


@contextmanager
def reading(job_id: str) -> Iterator[None]:
    """Raise `UnreadableJob` where reading the job's fields in this context fails."""
    try:
        yield
    except (KeyError, TypeError, ValueError) as error:
        raise UnreadableJob(job_id, error) from error


@contextmanager
def leaving_out_unreadable() -> Iterator[None]:
    """Log `UnreadableJob`: one unreadable job must not spoil a list."""
    try:
        yield
    except UnreadableJob as error:
        _LOG.warning("left out of a list: %s", error)


def ask_for(pipe: Pipeline, job_id: str) -> None:
    """Ask for the two hashes that `job` takes."""
    pipe.hgetall(keys.job(job_id))
    pipe.hgetall(keys.job(job_id, "sealed"))


def job(job_id: str, fields: Mapping[str, str], sealed: Mapping[str, str]) -> Job:
    """A job from its hash and the one that workers cannot change; or `UnreadableJob`."""
    with reading(job_id):
        return _job(fields, sealed)


def _job(fields: Mapping[str, str], sealed: Mapping[str, str]) -> Job:
    asked, state = _spec(fields), JobState(fields["state"])
    variant = fields.get("variant", asked.variant)
    spec = asked if variant == AUTO else asked.settled(variant)
    ended_by: EndedBy | None = fields.get("ended_by")  # type: ignore[assignment]  # pydantic checks
    latest = json.loads(fields.get("latest", "{}"))
    spp, width, height = int(fields["spp"]), fields.get("width"), fields.get("height")
    times = {
        name: moment(fields[name])
        for name in ("created_at", "started_at", "paused_at", "ended_at", "finished_at")
        if name in fields
    }
    judged = (
        *("visible_pixels", "visible_fraction", "slope", "estimate_pixels", "estimate_fraction"),
        *("estimate_undetermined", "non_finite_pixels", "expected_spp"),
    )
    saved = int(fields.get("samples_saved", 0))
    cap = spec.max_spp * int(width or 0) * int(height or 0)
    return Job(
        id=fields["id"],
        name=fields["name"],
        owner=sealed.get("owner"),
        owner_name=sealed.get("owner_name"),
        state=state,
        outcome=outcome(state, ended_by),
        reason=fields["reason"],
        ended_by=ended_by,
        failed_slice=int(fields["failed_slice"]) if "failed_slice" in fields else None,
        spec=spec,
        frames_because=None if spec is asked else spec.frames_because(variant),
        scene_sha256=fields["scene_sha256"],
        variant=fields.get("variant"),
        width=int(width) if width else None,
        height=int(height) if height else None,
        spp=spp,
        held="held" in fields and fields["state"] == JobState.QUEUED,
        awaits=int(fields.get("awaits", 0)),
        image_spp=_image_spp(fields),
        committed_spp=costs.committed_spp(fields, spec.slice_spp),
        points=int(fields["points"]),
        **{name: latest.get(name) for name in judged},
        spp_min=_zone_spp(fields, latest, "spp_min"),
        spp_max=_zone_spp(fields, latest, "spp_max"),
        expected_s=costs.seconds_to(latest.get("expected_spp"), latest, fields),
        verdict=json.loads(fields["verdict"]) if "verdict" in fields else None,
        samples_saved=saved,
        saved_fraction=saved / cap if saved and cap else 0.0,
        machine_s=int(fields["machine_ms"]) / 1000,
        core_hours=costs.core_hours(fields),
        saved_core_hours=costs.saved_core_hours(fields, spec.slice_spp),
        wasted_s=int(fields.get("wasted_ms", 0)) / 1000,
        second_tries=int(fields.get("second_tries", 0)),
        notes=_notes(fields),
        again=Again.model_validate_json(fields["again"]) if "again" in fields else None,
        continued_spp=int(fields.get("continued_spp", 0)),
        paused_s=int(fields.get("paused_ms", 0)) / 1000,
        in_shot=frame_of_shot(fields),
        notices=_notices(sealed),
        **times,
        deleted_at=moment(sealed["deleted_at"]) if "deleted_at" in sealed else None,
    )


def new_job(
    spec: JobSpec,
    *,
    name: str,
    scene_sha256: str,
    owner: str = "",
    notes: tuple[str, ...] = (),
    again: Again | None = None,
) -> NewJob:
    """A new job, with an id of its own; `notes` say what of its spec was changed."""
    assert fitted(spec) == spec, "steps and the cap are whole numbers of slices"
    fields: dict[str, str | int] = {
        "name": name,
        "spec": spec.model_dump_json(),
        "scene_sha256": scene_sha256,
        "owner": owner,
        "asked_variant": spec.variant,
        "need": fit.need(spec),
        "slice_spp": spec.slice_spp,
        **({"by_zones": 1} if spec.by_zones else {}),
        **({"fitted": json.dumps(notes)} if notes else {}),
        **({} if again is None else {"again": again.model_dump_json()}),
        "batch": spec.batch or "",
        "planned": 0,
        "issued": 0,
        "ready": 0,
        "leased": 0,
        "committed": 0,
        "spp": 0,
        "points": 0,
        "machine_ms": 0,
    }
    return NewJob(secrets.token_hex(6), fields, _sealed(spec.notice))


def _sealed(notice: NoticeSpec) -> dict[str, str]:
    """Who hears of a job's end, where, and by which secret."""
    sealed = {}
    if notice.receivers:
        sealed["receivers"] = " ".join(notice.receivers)
    if notice.url is not None and notice.secret is not None:
        sealed |= {"notice_url": notice.url, "notice_secret": notice.secret.get_secret_value()}
    return sealed


def frame_of_shot(fields: Mapping[str, str | None]) -> FrameOfShot | None:
    """How a frame of a shot stands; None of another job."""
    shot, waits, answer = map(fields.get, ("shot", "shot_waits", "shot_answer"))
    if not shot:
        return None
    return FrameOfShot(
        id=shot,
        waits=FrameWait.model_validate_json(waits) if waits else None,
        answer=FrameAnswer.model_validate_json(answer) if answer else None,
    )


def as_shot(jobs: tuple[NewJob, ...]) -> tuple[NewJob, ...]:
    """These jobs as the frames of one shot."""
    return tuple(replace(job, fields={**job.fields, "shot": jobs[0].id}) for job in jobs)


def _notes(fields: Mapping[str, str]) -> tuple[str, ...]:
    """What was changed of its spec, then those of the worker and the monitor; each once."""
    found = (json.loads(fields.get(name, "[]")) for name in ("fitted", "notes"))
    return tuple(dict.fromkeys(chain(*found)))


def _notices(sealed: Mapping[str, str]) -> tuple[Notice, ...]:
    """What became of its notices, by their receivers."""
    return tuple(
        _notice(receiver, json.loads(text))
        for name, text in sorted(sealed.items())
        if (receiver := name.removeprefix("notice ")) != name
    )


def _notice(receiver: str, found: dict[str, Any]) -> Notice:
    at, error = moment(found["at"]), found.get("error")
    return Notice(to=receiver, state=found["state"], at=at, error=error)


def _spec(fields: Mapping[str, str]) -> JobSpec:
    """The spec as its user asked for it, with later changes."""
    spec = stored_spec(fields["spec"])
    if "priority" in fields:
        spec = spec.model_copy(update={"priority": int(fields["priority"])})
    return spec


def _zone_spp(fields: Mapping[str, str], latest: dict[str, Any], name: str) -> int | None:
    """That of the final image if it has later slices than the newest point."""
    return int(fields[name]) if name in fields else latest.get(name)


def _image_spp(fields: Mapping[str, str]) -> int | None:
    results = fields.get("results")
    if not results:
        return None
    return blobs.spp_of_set(results) or int(fields["spp"]) or None
