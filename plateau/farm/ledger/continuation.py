"""Continues a job that has ended: a new job takes over its samples.

The old job keeps its image, its curve and its reason. The new one starts after the old one's last
kept sample, so that no sample is rendered twice, and its image is to the bit that of a job that
never stopped there. An ended job has kept either

- its *slices*, if asked to: they are merged again, so everything may change but their sampling. A
  cap that is not beyond them renders nothing;
- or its *sums*, the last checkpoint: the merge and the curve continue from it. Then the view, the
  step stay, and a rule that compares with earlier images must have seen them.

If more is to be rendered, the kept samples must be those that a job of the new cap draws: on scalar
variants the cap decides passes and seeds (see `plateau.farm.model.seeds`). See `lost_by`.
"""

import hashlib
from collections.abc import Collection
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, Final

from plateau.farm.ledger import records
from plateau.farm.ledger.jobs import Created, Jobs, request_key
from plateau.farm.ledger.ownership import Checkpoint
from plateau.farm.model.aovs import GUIDED_SPP
from plateau.farm.model.errors import JobNotEnded, JobNotFound
from plateau.farm.model.job import NONE_LEFT, Again, Job
from plateau.farm.model.seeds import SeedRange, SeedsExhausted
from plateau.farm.model.slices.plan import Plan
from plateau.farm.model.slices.rounds import Round
from plateau.farm.model.spec import JobSpec, texts
from plateau.farm.model.spec.notice import NoticeSpec
from plateau.farm.model.spec.parts import LAG
from plateau.farm.redis import keys
from plateau.farm.redis.client import RedisClient
from plateau.farm.redis.commands.jobs import Continue, DecidedRound
from plateau.farm.redis.scripts import OnRedis

#: The fields of a spec that determine the samples, ...
_SAMPLING: Final = ("slice_spp", "variant", "seed", "sensor", "allocation", "inputs")
#: ... that the new job does not inherit, ...
_OWN: Final = ("shot", "notice", "after")
#: ... and that all points of a curve have in common.
_JUDGING: Final = ("view", "step", "denoise")


@dataclass(frozen=True)
class Remains:
    """The first slices of an ended job, as far as they were kept."""

    slices: int
    checkpoint: str  #: of their sums, as JSON; "" where the slices themselves are kept
    seeds: tuple[SeedRange, ...]  #: of each slice
    plan: Plan  #: of the ended job

    @property
    def spp(self) -> int:
        """Samples per pixel of these slices."""
        return self.plan.spp(self.slices)

    @property
    def kept(self) -> bool:
        """Whether the slices themselves are kept."""
        return not self.checkpoint


class Continuations(OnRedis):
    """Continues jobs that have ended. Methods raise `StoreUnavailable` when Redis is away."""

    def __init__(self, client: RedisClient) -> None:
        super().__init__(client)
        self._jobs = Jobs(client)

    def remains(self, job: Job) -> Remains | None:
        """The job's kept slices or sums; None if none are left.

        Raises
        ------
        JobNotEnded
            It has not ended, or its results are still being written.
        """
        if not job.state.ended or (job.finished_at is None and job.committed_spp):
            raise JobNotEnded(job.id, job.state.value)
        checkpoint = self._redis.hget(keys.job(job.id), "checkpoint")
        ledger = self._jobs.ledger(job.id)
        slices, committed = 0, records.prefix_length(ledger)
        plan = self._jobs.plan(job)
        if job.spec.keep_slices:
            slices, checkpoint = committed, None
            if plan.by_zones:  # where the slices end, a round ends
                slices = plan.end_of_rounds(slices)
        elif checkpoint is not None:
            slices = Checkpoint.model_validate_json(checkpoint).slices
        if not 0 < slices <= committed:
            return None
        drawn = (ledger[index] for index in range(slices))
        seeds = tuple(SeedRange(one["first_seed"], one["last_seed"]) for one in drawn)
        return Remains(slices, checkpoint or "", seeds, plan)

    def start(
        self,
        job: Job,
        remains: Remains,
        spec: JobSpec,
        *,
        idempotency_key: str = "",
        owner: str = "",
        notes: tuple[str, ...] = (),
    ) -> Created | None:
        """Create the job of `spec` that continues `job`; it renders at once.

        Nothing of `remains` is lost by the spec (`lost_by`); `notes` say what of it was changed.
        Returns None if what was left of the job has changed in the meantime.

        Raises
        ------
        JobNotFound
            The job went in the meantime.
        TooManyJobs, TooManyNeeds
            As `Jobs.create` raises them.
        """
        digest = hashlib.sha256(f"{job.id} {spec.as_request()}".encode()).hexdigest()
        name = spec.name or job.name
        new = records.new_job(
            spec,
            name=name,
            scene_sha256=job.scene_sha256,
            owner=owner,
            notes=notes,
            again=Again(of=job.id, kept_spp=remains.spp),
        )
        made = self._scripts.run(
            Continue(
                job=new,
                old=job.id,
                slices=remains.slices,
                checkpoint=remains.checkpoint,
                judged_spp=0 if remains.kept else remains.spp,
                samples=remains.plan.samples(remains.slices),
                rounds=_taken_rounds(job, remains, spec),
                idempotency=request_key(idempotency_key, owner),
                digest=digest,
                priority=spec.priority,
            )
        )
        if made.outcome == "missing":
            raise JobNotFound(job.id)
        if made.outcome == "changed":
            return None
        return self._jobs.created(made)


def _taken_rounds(job: Job, remains: Remains, spec: JobSpec) -> tuple[DecidedRound, ...]:
    """The rounds that the new job takes over, under its own cap.

    They are those of its slices, and those that the points of the curve chose which it takes over.
    What the old cap had forbidden is like the round before. Kept slices are judged again, so their
    images choose anew; where nothing is rendered after them, the plan ends.
    """
    had = remains.plan
    if not had.by_zones:
        return ()
    whole = replace(had, max_spp=spec.max_spp).rounds(remains.slices)
    decided = [one for one in had.decided if one.slices]
    plan = Plan.of(spec.settled(job.variant or spec.variant), job.width, job.height)
    wanted = max(0, whole - LAG) if remains.kept else whole
    like = Round(0, plan.step_slices, plan.slice_spp, None, plan.pixels)
    for one in [*decided[:wanted], *[None] * (wanted - len(decided))]:
        like = one or like
        if one is not None and one.first < remains.slices:  # it is begun
            plan = plan.with_round(one)
            continue
        plan = plan.with_round(plan.round_of(like.zones, like.slices * like.spp, like.spp))
        if not plan.decided[-1].slices:
            break
    if remains.kept and spec.max_spp <= remains.spp:
        plan = plan.with_round(Round(plan.stop, 0, 0, None, 0))
    return tuple(DecidedRound(one.first, one.as_json()) for one in plan.decided)


def changed_spec(spec: JobSpec, changes: dict[str, Any]) -> dict[str, Any]:
    """The fields of the spec with these changes: a JSON merge patch (RFC 7396), with one exception.

    Objects are merged and null means the default. The exception: a rule, an allocation or a
    denoising with a name replaces the whole of it. The shot, the notice and the jobs that it came
    after are not inherited; nor is a watched rule that now ends the job, nor a field of view where
    pixels per degree are given.
    """
    for field, read in (("parameters", texts.parameters), ("rule", texts.named)):
        with suppress(KeyError, ValueError):  # what is no NAME=VALUE is refused with the whole spec
            changes = {**changes, field: read(changes[field])}
    had: dict[str, Any] = _merged(spec.model_dump(mode="json"), dict.fromkeys(_OWN))
    merged: dict[str, Any] = _merged(had, changes, JobSpec.model_fields)
    view = changes.get("view")
    if isinstance(view, dict) and "pixels_per_degree" in view and "field_of_view_deg" not in view:
        merged["view"].pop("field_of_view_deg", None)
    for field in ("rule", "allocation", "denoise"):
        given = changes.get(field)
        if isinstance(given, dict) and "name" in given:
            merged[field] = given
    ends = changes.get("rule")
    if "watch" not in changes and isinstance(ends, dict):
        merged["watch"] = [one for one in had["watch"] if one["name"] != ends.get("name")]
    return merged


def _merged(target: Any, patch: Any, known: Collection[str] = ()) -> Any:
    """The target with the patch; a null of a missing name stays, unless the name is `known`."""
    if not isinstance(patch, dict):
        return patch
    merged = dict(target) if isinstance(target, dict) else {}
    for name, value in patch.items():
        if value is not None:
            merged[name] = _merged(merged.get(name), value, _known_in(name, value))
        elif name in merged or name in known:
            merged.pop(name, None)
        else:
            merged[name] = None  # the check of the whole spec refuses an unknown field
    return merged


def _known_in(name: str, part: Any) -> Collection[str]:
    """The names that a part of a spec may have and the old job's part lacks."""
    if name == "parameters" and isinstance(part, dict):
        return part.keys()
    return NoticeSpec.model_fields if name == "notice" else ()


def lost_by(job: Job, remains: Remains | None, spec: JobSpec) -> str | None:
    """Why a job of this spec cannot have the ended job's samples; None if it can.

    `NONE_LEFT`, or the field of the spec that prevents it.
    """
    if remains is None:
        return NONE_LEFT
    if spec.after:  # a job that continues another renders at once
        return "after"
    spec = spec.settled(job.variant or spec.variant)
    for name in _SAMPLING:
        if getattr(spec, name) != getattr(job.spec, name):
            return name
    if spec.parameter_strings() != job.spec.parameter_strings():
        return "parameters"
    if _slice_aovs(spec) != _slice_aovs(job.spec):
        return "aovs" if spec.aovs != job.spec.aovs else "denoise"
    if not remains.kept and (field := _lost_sums(job, remains, spec)):
        return field
    if spec.by_zones and spec.step != job.spec.step:  # each step has decided a later one
        return "step"
    if spec.max_spp > remains.spp and not _draws(job, remains, spec.max_spp):
        return "max_spp"
    return None


def _slice_aovs(spec: JobSpec) -> tuple[object, ...]:
    """The AOVs of the first slice, and those of one that is past all guides."""
    return spec.slice_aovs(0), spec.slice_aovs(GUIDED_SPP)  # as a slice has 1 spp or more


def _draws(job: Job, remains: Remains, cap: int) -> bool:
    """Whether a job with this cap (spp) draws the ended job's kept samples."""
    # The job has samples, so these are known.
    assert job.variant is not None
    assert job.width is not None
    assert job.height is not None
    spec = job.spec.model_copy(update={"max_spp": cap})
    try:
        schedule = spec.seed_schedule(job.variant, job.width, job.height)
    except SeedsExhausted:
        return False
    return all(
        schedule.seed_range(index, remains.plan.slice_spp_of(index)) == one
        for index, one in enumerate(remains.seeds)
    )


def _lost_sums(job: Job, remains: Remains, spec: JobSpec) -> str | None:
    """The field of the spec for which sums do not suffice."""
    for name in _JUDGING:
        if getattr(spec, name) != getattr(job.spec, name):
            return name
    if spec.keep_slices:  # the first are gone
        return "keep_slices"
    if spec.variance and not job.spec.by_quarters:
        return "variance"
    seen = (job.spec.rule, *job.spec.watch)
    for name, rules in (("rule", (spec.rule,)), ("watch", spec.watch)):
        if any(not rule.behaviour.continues and rule not in seen for rule in rules):
            return name
    return "max_spp" if spec.max_spp <= remains.spp else None
