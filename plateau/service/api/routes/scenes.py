"""The route that checks and stores a scene."""

from typing import Annotated

from fastapi import APIRouter, Depends

from plateau.farm.wire.views import SceneFound
from plateau.service.api.problems.catalogue import documented
from plateau.service.api.routes.submit import SCENE_PROBLEMS, SUBMISSION_BODY
from plateau.service.api.submission.storing import StoredScene, stored_scene

router = APIRouter(prefix="/v1/scenes", tags=["scenes"])


@router.post(
    "",
    openapi_extra=SUBMISSION_BODY,
    responses=documented(*SCENE_PROBLEMS),
)
def check_scene(found: Annotated[StoredScene, Depends(stored_scene)]) -> SceneFound:
    """Check a scene as `POST /v1/jobs` would, and store it, without a job.

    Takes the same parts. Of `spec`, only `parameters`, `sensor` and the fields that determine the
    seeds count. A scene that no job uses stays for at least an hour; submit it by its `sha256`.
    """
    about = {"sha256": found.sha256, "name": found.name, "bytes": found.bytes}
    return SceneFound(**about, **vars(found.summary))
