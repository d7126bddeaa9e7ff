"""The parts of a request to create a job.

An upload is never in memory: the framework spools it to disk as it arrives, where it is hashed and
checked, and from where it goes to the blob store.
"""

from collections.abc import AsyncIterator
from dataclasses import dataclass, replace
from typing import Final

from fastapi import Request
from starlette.datastructures import FormData, UploadFile

from plateau.farm.model.job import Again
from plateau.farm.model.spec import BatchSpec, JobSpec
from plateau.farm.model.spec.whole_slices import changes, fitted
from plateau.service.api.parts import parts_of
from plateau.service.api.problems import catalogue as problems
from plateau.service.api.problems.problem import Problem
from plateau.service.api.problems.spec_checks import with_notice
from plateau.service.api.submission.idempotency import idempotency_key
from plateau.service.api.submission.scene_parts import Scene, scene_part
from plateau.service.api.submission.submitted_spec import submitted_spec

#: The most files and other parts of a form, and the largest part that is not a file.
_MOST_FILES: Final = 2
_MOST_FIELDS: Final = 8
_MOST_FIELD_BYTES: Final = 1 << 20

_FIELDS: Final = frozenset({"scene", "scene_path", "scene_sha256", "spec"})


@dataclass(frozen=True)
class Submission:
    """The parts of a request to create a job."""

    spec: JobSpec | BatchSpec  #: in whole slices
    notes: tuple[str, ...]  #: what of it was changed
    idempotency_key: str
    scene: Scene
    again: Again | None = None  #: the job whose scene it is, if one is rendered again


async def submission(request: Request) -> AsyncIterator[Submission]:
    """Yield the request's parts, which stay on disk until the route is done."""
    media_type = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if media_type and media_type != "multipart/form-data":
        raise Problem(problems.NOT_MULTIPART, media_type=media_type)
    try:
        async with request.form(
            max_files=_MOST_FILES, max_fields=_MOST_FIELDS, max_part_size=_MOST_FIELD_BYTES
        ) as form:
            asked = await _submission(form, idempotency_key(request))
            farm = parts_of(request)
            yield replace(asked, spec=with_notice(asked.spec, farm.receivers, farm.targets))
    except OSError as error:
        raise Problem(problems.UPLOAD_NOT_KEPT, error=error.strerror) from error


async def _submission(form: FormData, key: str) -> Submission:
    unknown = sorted(set(form) - _FIELDS)
    if unknown:
        raise Problem(problems.UNKNOWN_PART, part=unknown[0])
    part = form.get("spec")
    text = (await part.read(_MOST_FIELD_BYTES)) if isinstance(part, UploadFile) else part
    wanted = submitted_spec(text or b"{}")
    spec = fitted(wanted)
    scene = scene_part(form.get("scene"), form.get("scene_path"), form.get("scene_sha256"))
    return Submission(spec, changes(wanted, spec), key, scene)
