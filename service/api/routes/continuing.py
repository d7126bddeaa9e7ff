"""Routes that continue an ended job: to more samples, or under another judgement."""

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
from plateau.farm.model.spec.whole_slices import changes as changes_of
from plateau.farm.model.spec.whole_slices import fitted
from plateau.farm.wire.json_numbers import whole_numbers
from plateau.farm.wire.views import JobView
from plateau.service.api.access.callers import CallerOf
from plateau.service.api.parts import Farm
from plateau.service.api.problems import problem as problems
from plateau.service.api.problems.problem import documented
from plateau.service.api.problems.spec_checks import (
    check_commands,
    check_webhook,
    invalid_field,
    invalid_spec,
    with_targets,
)
from plateau.service.api.routes.jobs import JobId, shown
from plateau.service.api.submission import idempotency
from plateau.service.api.submission.idempotency import IdempotencyKey
from plateau.service.api.submission.merge_patch import merge_patch
from plateau.service.api.submission.submitted_spec import check_alone, check_names

router = APIRouter(prefix="/v1/jobs/{job_id}", tags=["jobs"])

_ROUTE: Final[dict[str, Any]] = {
    "status_code": 201,
    "openapi_extra": {"parameters": idempotency.PARAMETERS},
    "responses": {
        201: {
            "headers": idempotency.NEW_JOB,
        },
        **documented(
            problems.MALFORMED_REQUEST,
            problems.UNKNOWN_JOB,
            problems.CANNOT_CONTINUE,
            problems.TOO_MANY_JOBS,
            problems.KEY_REUSED,
            problems.UPLOAD_TOO_LARGE,
            problems.INVALID_REQUEST,
            problems.INVALID_SPEC,
        ),
    },
}


def _described(schema: JsonDict) -> None:
    schema.update(merge_patch(JobSpec.model_json_schema()), title="SpecChanges")


class SpecChanges(RootModel[dict[str, Any]]):
    """The fields of the spec that change."""

    model_config = ConfigDict(json_schema_extra=_described)


Changes = Annotated[
    SpecChanges,
    Body(
        description="the fields of the spec that change: a JSON merge patch (RFC 7396), except "
        "that a `rule` with a `name` replaces the old one whole",
        openapi_examples={
            "a stricter target": {"value": {"rule": {"target": 0.0001}}},
            "a higher cap": {"value": {"max_spp": 20_000}},
            "another view": {"value": {"view": {"field_of_view_deg": 20}}},
        },
    ),
]


@dataclass(frozen=True)
class Asker:
    """The dependencies of both routes, and what both do with them."""

    response: Response
    farm: Farm
    who: CallerOf
    key: IdempotencyKey

    def look_at(self, job_id: str) -> tuple[Job, Remains]:
        """The ended job, and what remains of it."""
        job = self.farm.job(job_id)
        return job, self.farm.continuations.remains(job)

    def start(self, job: Job, remains: Remains, changes: dict[str, Any]) -> JobView:
        """Start the new job, with these changes to the spec."""
        try:
            changed = changed_spec(job.spec, whole_numbers(changes))
            # From JSON, which has no tuples: strict mode still refuses a number in quotes.
            wanted = JobSpec.model_validate_json(json.dumps(changed), strict=True)
        except ValidationError as error:
            raise invalid_spec(error) from error
        spec = fitted(wanted, keep_slices=True)
        check_webhook(spec, self.farm.receivers)
        spec = with_targets(spec, self.farm.targets)
        check_commands(spec, self.farm.commands)
        check_names(spec)
        check_alone(spec)
        check(job, remains, spec)
        new = self.farm.continuations.start(
            job,
            remains,
            spec,
            idempotency_key=self.key,
            owner=self.who.id,
            notes=changes_of(wanted, spec),
        )
        idempotency.settle(new, self.key, self.response)
        self.response.headers["Location"] = f"/v1/jobs/{new.job.id}"
        return shown([new.job], self.farm, self.who)[0]


@router.post("/continue", **_ROUTE)
def continue_job(job_id: JobId, asker: Annotated[Asker, Depends()], changes: Changes) -> JobView:
    """Continue an ended job, to a stricter rule or a higher cap, as a new job.

    No sample is rendered twice: the new job takes over those of the old one, which stays as it is.
    If the old job kept its slices, they are judged anew, so the view, step and zones may change
    too. Otherwise the new job continues from the sums, which are kept for PLATEAU_KEEP_SUMS_DAYS.
    The new job does not inherit the batch, the webhook, the targets of notifications, `then` and
    `after`. A cap with which scalar_rgb would have drawn other samples is refused; the detail names
    the caps that continue the same samples.
    """
    return asker.start(*asker.look_at(job_id), changes.root)


@router.post("/rejudge", **_ROUTE)
def rejudge_job(job_id: JobId, asker: Annotated[Asker, Depends()], changes: Changes) -> JobView:
    """Judge an ended job's slices again, under another view or by other rules, as a new job.

    The job must have kept its slices (`keep_slices`). Nothing is rendered: the new job's cap is the
    end of the slices.
    """
    job, remains = asker.look_at(job_id)
    if not remains.kept:
        raise CannotContinue(
            job.id,
            "its slices were not kept, so they cannot be judged again: submit with keep_slices",
        )
    cap = remains.spp
    if "max_spp" in changes.root:
        raise invalid_field(
            problems.INVALID_SPEC,
            "spec.max_spp",
            f"is where the slices end, at {cap} spp; to render more of them, POST to continue",
        )
    return asker.start(job, remains, {**changes.root, "max_spp": cap})
