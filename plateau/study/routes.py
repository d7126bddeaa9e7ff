"""The routes of observer studies: making, taking part, export."""

import asyncio
from dataclasses import dataclass, field
from typing import Annotated, Any, Final

from fastapi import APIRouter, Depends, FastAPI, Path, Request, Response
from fastapi.concurrency import run_in_threadpool

from plateau.farm.redis.client import RedisClient
from plateau.farm.wire.examples import JOB_ID
from plateau.service.api.access.callers import CallerOf
from plateau.service.api.http.etags import FINAL
from plateau.service.api.parts import Parts
from plateau.service.api.problems import catalogue as problems
from plateau.service.api.problems.catalogue import documented
from plateau.service.api.problems.handlers import answer_as_they_are
from plateau.service.api.problems.problem import Problem, ProblemType
from plateau.service.api.routes.pages import page
from plateau.study import examples
from plateau.study.ledger import Studies, study_level, study_reference
from plateau.study.levels import check_levels, default_levels, kept_slices
from plateau.study.model import (
    PSEUDONYM,
    CannotStudy,
    Observer,
    ObserverNotFound,
    Study,
    StudyNotFound,
    TrialNotFound,
)
from plateau.study.results import StudyResults, trials_csv
from plateau.study.views import (
    AnswerView,
    NewAnswer,
    NewStudy,
    ObserverView,
    StudyList,
    StudyView,
    TakingPart,
    observer_view,
    study_view,
)

# fmt: off
_ERROR, _ID = "{error}", examples.STUDY_ID
_NOT_YOUR_STUDY: Final = ProblemType(
    "not-your-study", 403, "Study of another key",
    "study {study} belongs to another key", problems.NOT_YOUR_JOB.remedy, example={"study": _ID})
_STUDY_OF_NO_KEY: Final = _NOT_YOUR_STUDY.case(
    "study {study} was made without a key", problems.JOB_OF_NO_KEY.remedy)
_UNKNOWN_STUDY: Final = ProblemType(
    "unknown-study", 404, "Unknown study", _ERROR,
    "GET /v1/studies lists those there are", example={"error": StudyNotFound(_ID)})
_UNKNOWN_PICTURE: Final = _UNKNOWN_STUDY.case(
    "there is no study {study!r} with this picture",
    "GET /v1/studies lists the studies and their levels")
_UNKNOWN_OBSERVER: Final = ProblemType(
    "unknown-observer", 404, "Unknown observer", _ERROR,
    example={"error": ObserverNotFound(_ID, "o-7f3a")})
_UNKNOWN_TRIAL: Final = ProblemType(
    "unknown-trial", 404, "Unknown trial", _ERROR, example={"error": TrialNotFound(_ID, 14, 14)})
_NOT_KEPT: Final = f"job {JOB_ID} did not keep its slices; submit the scene again with keep_slices"
_CANNOT_STUDY: Final = ProblemType(
    "cannot-study", 409, "Study cannot be created", _ERROR, example={"error": _NOT_KEPT})
problems.of_extension(
    _NOT_YOUR_STUDY, _UNKNOWN_STUDY, _UNKNOWN_OBSERVER, _UNKNOWN_TRIAL, _CANNOT_STUDY)
# fmt: on

router = APIRouter(prefix="/v1/studies", tags=["studies"])


@dataclass(frozen=True)
class _Parts:
    """What the routes work with."""

    api: Parts
    studies: Studies
    results: StudyResults
    #: Merging takes a few hundred MB, so one study is made at a time. Who waits holds no thread.
    turn: asyncio.Lock = field(default_factory=asyncio.Lock)


async def _parts(request: Request) -> _Parts:
    found: _Parts = request.app.state.study
    return found


def mount(app: FastAPI, client: RedisClient) -> None:
    """Add the routes and their errors' problems to the API."""
    studies = Studies(client)
    app.state.study = _Parts(app.state.parts, studies, StudyResults(studies))
    app.include_router(router)
    for path in ("/studies", "/studies/{study_id}", "/studies/{study_id}/observe"):
        app.add_api_route(path, page, include_in_schema=False)
    answer_as_they_are(
        app,
        {
            StudyNotFound: _UNKNOWN_STUDY,
            ObserverNotFound: _UNKNOWN_OBSERVER,
            TrialNotFound: _UNKNOWN_TRIAL,
            CannotStudy: _CANNOT_STUDY,
        },
    )


_Farm = Annotated[_Parts, Depends(_parts)]
_StudyId = Annotated[
    str, Path(pattern=r"^[0-9a-f]{12}$", description="the study's id", examples=[examples.STUDY_ID])
]
_Name = Annotated[
    str,
    Path(
        pattern=PSEUDONYM,
        description="the observer's pseudonym: no name or address, please",
        examples=[examples.OBSERVER["name"]],
    ),
]

_INVALID: Final = (_UNKNOWN_STUDY, problems.INVALID_REQUEST)
_PNG: Final[dict[int | str, dict[str, Any]]] = {
    200: {
        "description": "the picture",
        "content": {"image/png": {"schema": {"type": "string", "format": "binary"}}},
    },
    **documented(problems.SPOILED_FILE, *_INVALID),
}


def _csv(example: str) -> dict[int | str, dict[str, Any]]:
    text = {"schema": {"type": "string"}, "example": example}
    return {
        200: {"description": "the table", "content": {"text/csv": text}},
        **documented(*_INVALID),
    }


@router.post(
    "",
    status_code=201,
    responses={
        201: {
            "headers": {"Location": {"schema": {"type": "string"}, "description": "of the study"}}
        },
        **documented(problems.UNKNOWN_JOB, _CANNOT_STUDY, problems.INVALID_REQUEST),
    },
)
async def create_study(
    asked: NewStudy, farm: _Farm, who: CallerOf, response: Response
) -> StudyView:
    """Make a study from the kept slices of an ended job, and merge its pictures now.

    That takes a moment for each slice. The study has its own pictures, so the jobs may be forgotten
    afterwards. Repeated requests of one key make only one study.
    """
    async with farm.turn:
        study = await run_in_threadpool(_made, asked, farm, who.id)
    response.headers["Location"] = f"/v1/studies/{study.id}"
    return study


@router.get("", responses=documented())
def list_studies(farm: _Farm) -> StudyList:
    """List all studies, newest first."""
    return StudyList(studies=[_shown(farm, study) for study in farm.studies.all()])


@router.get("/{study_id}", responses=documented(*_INVALID))
def get_study(study_id: _StudyId, farm: _Farm) -> StudyView:
    """Show a study and its results so far. Observers should answer before they see it."""
    return _shown(farm, farm.studies.get(study_id))


@router.delete("/{study_id}", status_code=204, responses=documented(_NOT_YOUR_STUDY, *_INVALID))
def delete_study(study_id: _StudyId, farm: _Farm, who: CallerOf) -> None:
    """Remove a study with all its answers and pictures. This needs the key that made it."""
    study = farm.studies.get(study_id)
    if not who.may_steer(study.owner):
        kind = _NOT_YOUR_STUDY if study.owner else _STUDY_OF_NO_KEY
        raise Problem(kind, study=study.id)
    farm.studies.forget(study.id, farm.api.blobs)


@router.get("/{study_id}/reference.png", response_class=Response, responses=_PNG)
def get_study_reference(study_id: _StudyId, farm: _Farm) -> Response:
    """Show the reference."""
    return _picture(farm, study_id, study_reference(study_id))


@router.get("/{study_id}/levels/{spp}.png", response_class=Response, responses=_PNG)
def get_study_level(
    study_id: _StudyId,
    spp: Annotated[int, Path(ge=1, le=1_000_000, description="of the level", examples=[900])],
    farm: _Farm,
) -> Response:
    """Show a test image."""
    return _picture(farm, study_id, study_level(study_id, spp))


@router.get("/{study_id}/trials.csv", response_class=Response, responses=_csv(examples.TRIALS_CSV))
def get_study_trials(study_id: _StudyId, farm: _Farm) -> Response:
    """Export every answer, a line each, with its observer, pair and screen.

    `plateau study fit` reads it too, and gives intervals for the thresholds.
    """
    study = farm.studies.get(study_id)
    answers = farm.studies.answers(study)
    text = trials_csv(study, farm.studies.observers(study), answers)
    return _as_csv(f"{study.id}-trials.csv", text)


@router.put("/{study_id}/observers/{observer}", responses=documented(_CANNOT_STUDY, *_INVALID))
def join_study(study_id: _StudyId, observer: _Name, asked: TakingPart, farm: _Farm) -> ObserverView:
    """Take part in a study under a pseudonym.

    One who takes part already continues, with the screen of the first time.
    """
    study = farm.studies.get(study_id)
    return _observer(farm, study, farm.studies.join(study, observer, asked.screen))


@router.get("/{study_id}/observers/{observer}", responses=documented(_UNKNOWN_OBSERVER, *_INVALID))
def get_observer(study_id: _StudyId, observer: _Name, farm: _Farm) -> ObserverView:
    """Show an observer's pairs, in order, and which of them have an answer."""
    study = farm.studies.get(study_id)
    return _observer(farm, study, farm.studies.observer(study, observer))


@router.put(
    "/{study_id}/observers/{observer}/answers/{trial}",
    responses=documented(_UNKNOWN_OBSERVER, _UNKNOWN_TRIAL, *_INVALID),
)
def answer_trial(
    study_id: _StudyId,
    observer: _Name,
    trial: Annotated[int, Path(ge=0, le=999, description="the pair's number", examples=[0])],
    asked: NewAnswer,
    farm: _Farm,
) -> AnswerView:
    """Answer a pair. Only the first answer to a pair counts, and the response shows that one.

    It is on disk when this returns. Repeating it is harmless.
    """
    study = farm.studies.get(study_id)
    who = farm.studies.observer(study, observer)
    counts = farm.studies.answer(study, who, trial, seen=asked.seen, seconds=asked.seconds)
    return AnswerView(**counts.model_dump())


def _made(asked: NewStudy, farm: _Parts, owner: str) -> StudyView:
    """Make the study of this request, unless there is one."""
    request = asked.model_dump(mode="json")
    if made := farm.studies.made(request, owner):
        return _shown(farm, made)
    # Imported at the first use: numpy and the metric take a fifth of the API's start.
    from plateau.study.pictures import are_independent, put_pictures

    job = farm.api.job(asked.job_id)
    other = farm.api.job(asked.reference_job_id or asked.job_id)
    slices, reference = kept_slices(farm.api.jobs, job), kept_slices(farm.api.jobs, other)
    if (other.width, other.height) != (job.width, job.height):
        raise CannotStudy(
            f"job {job.id} has {job.width}×{job.height} pixels, and the reference, job {other.id}, "
            f"has {other.width}×{other.height}; choose a reference of the same size"
        )
    slice_spp, reference_spp = job.spec.slice_spp, other.spec.slice_spp * len(reference)
    wanted = asked.levels or default_levels(asked.method, slice_spp, len(slices), reference_spp)
    levels = check_levels(wanted, slice_spp, len(slices))
    about = {
        "name": asked.name or job.name,
        "method": asked.method,
        "job_id": job.id,
        "reference_job_id": other.id,
        "independent": are_independent(farm.api.blobs, job, slices, other, reference),
        "levels": levels,
        "reference_spp": reference_spp,
        "slice_spp": slice_spp,
        "exposure_ev": job.spec.view.exposure_ev,
        "width": job.width,
        "height": job.height,
    }
    study_id = farm.studies.begin()
    try:
        digests = put_pictures(
            farm.api.blobs, study_id, job=job, slices=slices, levels=levels, reference=reference
        )
        study = farm.studies.create(study_id, request, owner, {**about, "sha256": digests})
    except CannotStudy:
        farm.studies.forget(study_id, farm.api.blobs)
        raise
    if study.id != study_id:  # an equal request was faster
        farm.studies.forget(study_id, farm.api.blobs)
    return _shown(farm, study)


def _shown(farm: _Parts, study: Study) -> StudyView:
    return study_view(study, farm.results.of(study))


def _observer(farm: _Parts, study: Study, who: Observer) -> ObserverView:
    return observer_view(study, who, farm.studies.answers(study))


def _picture(farm: _Parts, study_id: str, blob: str) -> Response:
    try:
        content = farm.api.files.content(blob, farm.studies.sha256(study_id, blob))
    except FileNotFoundError as error:
        raise Problem(_UNKNOWN_PICTURE, study=study_id) from error
    return Response(content, media_type="image/png", headers={"Cache-Control": FINAL})


def _as_csv(name: str, text: str) -> Response:
    headers = {"Content-Disposition": f'attachment; filename="{name}"', "Cache-Control": "no-cache"}
    return Response(text, media_type="text/csv; charset=utf-8", headers=headers)
