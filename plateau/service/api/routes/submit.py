"""The routes that take a scene: to check and store it, and to make jobs of it."""

from typing import Annotated, Any, Final

from fastapi import APIRouter, Depends, Response

from plateau.farm.model.spec import JobSpec
from plateau.farm.wire import examples
from plateau.farm.wire.batch_views import BATCH, BatchView, batch_path, batch_view
from plateau.farm.wire.views import JobView, SceneFound
from plateau.service.api.access.callers import CallerOf
from plateau.service.api.parts import Farm
from plateau.service.api.problems import catalogue as problems
from plateau.service.api.problems.catalogue import documented
from plateau.service.api.routes.jobs import shown
from plateau.service.api.submission import idempotency
from plateau.service.api.submission.creation import create_job
from plateau.service.api.submission.reading import Submission, submission
from plateau.service.api.submission.storing import StoredScene, stored_scene

router = APIRouter()

#: The body of a request that brings or names a scene.
_BODY: Final[dict[str, Any]] = {
    "requestBody": {
        "required": True,
        "content": {
            "multipart/form-data": {
                "schema": {
                    "type": "object",
                    "properties": {
                        "scene": {
                            "type": "string",
                            "format": "binary",
                            "description": "a Mitsuba 3 XML, or a zip of one with its meshes and "
                            "textures",
                        },
                        "scene_path": {
                            "type": "string",
                            "maxLength": 4096,
                            "description": "instead of `scene`: one in a scene root of the "
                            "service, `{ROOT}/PATH`",
                        },
                        "scene_sha256": {
                            "type": "string",
                            "pattern": "^([0-9a-f]{64})?$",
                            "description": "instead of `scene`: one that is already stored; "
                            "empty, as a web form sends it, it counts as left out",
                        },
                        "spec": {
                            "oneOf": [
                                {"$ref": "#/components/schemas/JobSpec"},
                                {"$ref": "#/components/schemas/BatchSpec"},
                            ],
                            "description": "of one job, or of many where `parameters` is a list",
                        },
                    },
                    # One of the three is needed. With anyOf alone, generators of clients see no
                    # parts.
                    "if": {"not": {"required": ["scene"]}},
                    "then": {
                        "anyOf": [{"required": ["scene_sha256"]}, {"required": ["scene_path"]}]
                    },
                    "additionalProperties": False,
                },
                "examples": {
                    "an upload": {"value": {"scene": examples.SCENE_XML, "spec": examples.SPEC}},
                    "a stored scene": {
                        "value": {"scene_sha256": examples.SCENE_SHA256, "spec": {}}
                    },
                    "a batch": {
                        "value": {"scene": examples.SCENE_XML, "spec": examples.BATCH_SPEC}
                    },
                },
                "encoding": {"spec": {"contentType": "application/json"}},
            }
        },
    }
}
_SUBMISSION: Final[dict[str, Any]] = {**_BODY, "parameters": idempotency.PARAMETERS}

#: How a scene can be refused that comes with a request.
_SCENE_PROBLEMS: Final = (
    problems.MALFORMED_REQUEST,
    problems.UPLOAD_TOO_LARGE,
    problems.NOT_MULTIPART,
    problems.INVALID_REQUEST,
    problems.INVALID_SPEC,
    problems.NO_SCENE,
    problems.UNKNOWN_SCENE,
    problems.BROKEN_SCENE,
    problems.BUSY,
    problems.TOO_MANY_SCENES,
)


@router.post(
    "/v1/scenes",
    tags=["scenes"],
    openapi_extra=_BODY,
    responses=documented(*_SCENE_PROBLEMS),
)
def check_scene(found: Annotated[StoredScene, Depends(stored_scene)]) -> SceneFound:
    """Check a scene as `POST /v1/jobs` would, and store it, without a job.

    Takes the same parts. Of `spec`, only `parameters`, `sensor` and the fields that determine the
    seeds count. A scene that no job uses stays for at least an hour; submit it by its `sha256`.
    """
    about = {"sha256": found.sha256, "name": found.name, "bytes": found.bytes}
    return SceneFound(**about, **vars(found.summary))


@router.post(
    "/v1/jobs",
    tags=["jobs"],
    status_code=201,
    response_model=None,  # would be described as anyOf, and not as oneOf
    openapi_extra=_SUBMISSION,
    responses={
        201: {
            "content": {
                "application/json": {
                    "schema": {
                        "oneOf": [
                            {"$ref": "#/components/schemas/JobView"},
                            {"$ref": "#/components/schemas/BatchView"},
                        ]
                    },
                    "examples": {"a job": {"value": examples.JOB}, "a batch": {"value": BATCH}},
                }
            },
            "headers": {
                "Location": {
                    "schema": {"type": "string"},
                    "description": "path of the job, or of the batch",
                },
                **idempotency.REPLAYED,
            },
        },
        **documented(*_SCENE_PROBLEMS, problems.KEY_REUSED, problems.TOO_MANY_JOBS),
    },
)
def submit_job(
    response: Response,
    asked: Annotated[Submission, Depends(submission)],
    scene: Annotated[StoredScene, Depends(stored_scene)],
    farm: Farm,
    who: CallerOf,
) -> JobView | BatchView:
    """Submit a scene: it is checked, stored once, and queued as one new job or several.

    `spec` and any of its fields may be omitted. If `parameters` is a list, each entry makes a job,
    all of them or none, and the answer is their batch; without a `batch` in the spec, the service
    names it. The header `Idempotency-Replayed: true` says that an earlier request with the same key
    made the job.
    """
    created = create_job(asked, scene, farm, owner=who.id)
    idempotency.settle(created, asked.idempotency_key, response)
    batch = created.job.spec.batch
    if isinstance(asked.spec, JobSpec) or batch is None:
        response.headers["Location"] = f"/v1/jobs/{created.job.id}"
        return shown([created.job], farm, who)[0]
    response.headers["Location"] = batch_path(batch)
    return batch_view(farm.batches.get(batch))
