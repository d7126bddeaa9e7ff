"""The route that renders an ended job again, with its samples where they can be kept."""

import json
from typing import Annotated, Any, Final

from fastapi import APIRouter, Body, Request, Response
from fastapi.concurrency import run_in_threadpool
from pydantic import ConfigDict, RootModel, ValidationError
from pydantic.config import JsonDict

from plateau.farm.ledger.continuation import changed_spec, lost_by
from plateau.farm.ledger.jobs import Created
from plateau.farm.model.job import Again, Job
from plateau.farm.model.scene_roots import is_root_tag
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.spec.whole_slices import changes as changes_of
from plateau.farm.model.spec.whole_slices import fitted
from plateau.farm.wire.json_numbers import whole_numbers
from plateau.farm.wire.views import JobView
from plateau.service.api.access.callers import CallerOf
from plateau.service.api.parts import Farm, Parts
from plateau.service.api.problems import catalogue as problems
from plateau.service.api.problems.catalogue import documented
from plateau.service.api.problems.spec_checks import check_size, invalid_spec, with_notice
from plateau.service.api.routes.jobs import JobId, shown
from plateau.service.api.submission import idempotency
from plateau.service.api.submission.creation import create_job, required
from plateau.service.api.submission.idempotency import IdempotencyKey
from plateau.service.api.submission.reading import Submission
from plateau.service.api.submission.storing import stored_scene
from plateau.service.api.submission.submitted_spec import check_alone, check_names

router = APIRouter(prefix="/v1/jobs/{job_id}", tags=["jobs"])


#: Each of any type: null removes a field, and an object may have some of its fields only.
_FIELDS: Final[JsonDict] = {
    name: {"description": field.description or ""} for name, field in JobSpec.model_fields.items()
}


class SpecChanges(RootModel[dict[str, Any]]):
    """The fields of the spec that change, as `JobSpec` has them."""

    model_config = ConfigDict(
        json_schema_extra={"properties": _FIELDS, "additionalProperties": False}
    )


Changes = Annotated[
    SpecChanges,
    Body(
        description="the fields of the spec that change: a JSON merge patch (RFC 7396), except "
        "that a `rule` with a `name` replaces the old one whole",
        openapi_examples={
            "a stricter target": {"value": {"rule": {"target": 9.7}}},
            "a higher cap": {"value": {"max_spp": 20_000}},
            "another view": {"value": {"view": {"pixels_per_degree": 13}}},
            "other samples": {"value": {"seed": 1}},
        },
    ),
]


@router.post(
    "/again",
    status_code=201,
    openapi_extra={"parameters": idempotency.PARAMETERS},
    responses={
        201: {"headers": idempotency.NEW_JOB},
        **documented(
            problems.MALFORMED_REQUEST,
            problems.UNKNOWN_JOB,
            problems.JOB_NOT_ENDED,
            problems.TOO_MANY_JOBS,
            problems.TOO_MANY_NEEDS,
            problems.KEY_REUSED,
            problems.UPLOAD_TOO_LARGE,
            problems.INVALID_REQUEST,
            problems.INVALID_SPEC,
            problems.UNKNOWN_SCENE,
            problems.BROKEN_SCENE,
            problems.BUSY,
        ),
    },
)
async def render_again(
    job_id: JobId,
    changes: Changes,
    request: Request,
    response: Response,
    key: IdempotencyKey,
    farm: Farm,
    who: CallerOf,
) -> JobView:
    """Render an ended job again, as a new job of the same scene and a changed spec.

    The new job has the samples of the old one, which stays as it is, where they are left and are
    those that the new spec draws; `again` says how many it keeps, or why none. Slices that were
    kept (`keep_slices`) are judged anew, so the view and step may change; with a `max_spp`
    that is not beyond them, nothing is rendered. Otherwise the sums of the samples are continued,
    which are kept for PLATEAU_KEEP_SUMS_DAYS. Another `seed` draws other samples. A notice,
    `after` and `shot` are not inherited.
    """
    asked, created = await run_in_threadpool(_continued, job_id, changes.root, key, farm, who.id)
    if created is None:
        scene = await stored_scene(request, asked, farm, who)
        created = await run_in_threadpool(create_job, asked, scene, farm, owner=who.id)
    idempotency.settle(created, key, response)
    response.headers["Location"] = f"/v1/jobs/{created.job.id}"
    return (await run_in_threadpool(shown, [created.job], farm, who))[0]


def _continued(
    job_id: str, changes: dict[str, Any], key: str, farm: Parts, owner: str
) -> tuple[Submission, Created | None]:
    """What is asked for, and the job that continues the old one; None if no samples can be kept."""
    old = farm.job(job_id)
    wanted = _wanted(old, changes)
    spec = fitted(wanted, keep_slices=wanted.slice_spp == old.spec.slice_spp)
    spec = with_notice(spec, farm.receivers, farm.targets)
    of_roots = filter(is_root_tag, old.spec.requires)  # its scene still lies there
    spec = spec.model_copy(update={"requires": required(spec, of_roots)})
    check_names(spec)
    check_alone(spec)
    notes = changes_of(wanted, spec)
    while True:
        remains = farm.continuations.remains(old)
        why = lost_by(old, remains, spec)
        if remains is None or why is not None:
            again = Again(of=old.id, kept_spp=0, why=why)
            return Submission(spec, notes, key, old.scene_sha256, again), None
        check_size(spec, old.width, old.height)
        created = farm.continuations.start(
            old, remains, spec, idempotency_key=key, owner=owner, notes=notes
        )
        if created is not None:  # otherwise what remains has just changed
            return Submission(spec, notes, key, old.scene_sha256), created


def _wanted(old: Job, changes: dict[str, Any]) -> JobSpec:
    """The spec with these changes."""
    try:
        # From JSON, which has no tuples: strict mode still refuses a number in quotes.
        changed = json.dumps(changed_spec(old.spec, whole_numbers(changes)))
        return JobSpec.model_validate_json(changed, strict=True)
    except ValidationError as error:
        raise invalid_spec(error) from error
