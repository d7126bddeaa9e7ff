"""Routes that go on with a job that has ended: to more samples, or under another judgement."""

import json
from dataclasses import dataclass
from typing import Annotated, Any, Final

from fastapi import APIRouter, Body, Depends, Response
from pydantic import ConfigDict, RootModel, ValidationError
from pydantic.config import JsonDict

from plateau.farm.ledger.continuation import Remains, changed_spec, check
from plateau.farm.model.errors import CannotContinue
from plateau.farm.model.job import Job
from plateau.farm.model.spec import JobSpec
from plateau.farm.wire.json_numbers import whole_numbers
from plateau.farm.wire.views import JobView
from plateau.service.api.access.callers import CallerOf
from plateau.service.api.parts import Parts, parts
from plateau.service.api.problems import problem as problems
from plateau.service.api.problems.problem import documented
from plateau.service.api.problems.spec_checks import check_webhook, invalid_field, invalid_spec
from plateau.service.api.routes.jobs import JobId, shown
from plateau.service.api.submission import idempotency
from plateau.service.api.submission.idempotency import IdempotencyKey
from plateau.service.api.submission.merge_patch import merge_patch
from plateau.service.api.submission.submitted_spec import check_batch_name

router = APIRouter(prefix="/v1/jobs/{job_id}", tags=["jobs"])

_RESPONSES: Final[dict[int | str, dict[str, Any]]] = {
    201: {
        "headers": {
            **idempotency.REPLAYED,
            "Location": {"schema": {"type": "string"}, "description": "path of the new job"},
        }
    },
    **documented(
        problems.MALFORMED_REQUEST,
        problems.UNKNOWN_JOB,
        problems.CANNOT_CONTINUE,
        problems.UNEVEN_BATCH,
        problems.TOO_MANY_JOBS,
        problems.KEY_REUSED,
        problems.UPLOAD_TOO_LARGE,
        problems.INVALID_REQUEST,
        problems.INVALID_SPEC,
    ),
}


def _described(schema: JsonDict) -> None:
    """Say of a body's schema which fields there are, as the spec has them."""
    schema.update(merge_patch(JobSpec.model_json_schema()), title="SpecChanges")


class SpecChanges(RootModel[dict[str, Any]]):
    """Fields of the spec that are to be others than the old job's."""

    model_config = ConfigDict(json_schema_extra=_described)


Changes = Annotated[
    SpecChanges,
    Body(
        description="fields of the spec that are to be others than the old job's: a JSON merge "
        "patch (RFC 7396), except that a `rule` with a `name` replaces the old one whole",
        openapi_examples={
            "a stricter target": {"value": {"rule": {"target": 0.0001}}},
            "a higher cap": {"value": {"max_spp": 20_000}},
            "another view": {"value": {"view": {"field_of_view_deg": 20}}},
        },
    ),
]


@dataclass(frozen=True)
class Asker:
    """Who asks for the new job, and how it is answered."""

    response: Response
    farm: Annotated[Parts, Depends(parts)]
    who: CallerOf
    key: IdempotencyKey

    def look_at(self, job_id: str) -> tuple[Job, Remains]:
        """The ended job, and what is left of it."""
        job = self.farm.job(job_id)
        return job, self.farm.continuations.remains(job)

    def start(self, job: Job, remains: Remains, changes: dict[str, Any]) -> JobView:
        """The job that goes on with the ended one, its spec changed so."""
        try:
            changed = changed_spec(job.spec, whole_numbers(changes))
            # As JSON, in which a list may be a tuple; a number in quotes is none there either.
            spec = JobSpec.model_validate_json(json.dumps(changed), strict=True)
        except ValidationError as error:
            raise invalid_spec(error) from error
        check_webhook(spec, self.farm.receivers)
        check_batch_name(spec)
        check(job, remains, spec)
        new = self.farm.continuations.start(
            job, remains, spec, idempotency_key=self.key, owner=self.who.id
        )
        idempotency.settle(new, self.key, self.response)
        self.response.headers["Location"] = f"/v1/jobs/{new.job.id}"
        return shown([new.job], self.farm, self.who)[0]


@router.post(
    "/continue",
    status_code=201,
    responses=_RESPONSES,
    openapi_extra={"parameters": idempotency.PARAMETERS},
)
def continue_job(job_id: JobId, asker: Annotated[Asker, Depends()], changes: Changes) -> JobView:
    """Go on with an ended job, to a stricter rule or a higher cap, as a new job.

    No sample is rendered twice: the new job takes over those of the old one, which stays as it is.
    Where the old one kept its slices they are judged anew, so its view, step and zones may change
    too; otherwise its sums go on, for as long after its end as PLATEAU_KEEP_SUMS_DAYS says. The
    batch and the webhook are the old job's own: name them, if the new one is to have any. A cap
    with which scalar_rgb would have drawn other samples is refused; the detail names those that go
    on.
    """
    return asker.start(*asker.look_at(job_id), changes.root)


@router.post(
    "/rejudge",
    status_code=201,
    responses=_RESPONSES,
    openapi_extra={"parameters": idempotency.PARAMETERS},
)
def rejudge_job(job_id: JobId, asker: Annotated[Asker, Depends()], changes: Changes) -> JobView:
    """Judge an ended job's slices again, under another view or by other rules, as a new job.

    For a job that kept its slices (`keep_slices`). Nothing is rendered: the new job's cap is where
    the slices end.
    """
    job, remains = asker.look_at(job_id)
    if not remains.kept:
        raise CannotContinue(
            job.id,
            "its slices were not kept, so they cannot be judged again: submit with keep_slices",
        )
    cap = remains.slices * job.spec.slice_spp
    if "max_spp" in changes.root:
        raise invalid_field(
            problems.INVALID_SPEC,
            "spec.max_spp",
            f"is where the slices end, at {cap} spp; to render more of them, POST to continue",
        )
    return asker.start(job, remains, {**changes.root, "max_spp": cap})
