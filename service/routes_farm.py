"""Routes for the farm itself: workers, scenes, health, and what a problem's type means."""

from typing import Annotated

from fastapi import APIRouter, Depends, Path, Request, Response

from service import examples, metrics, problems
from service.callers import CallerOf
from service.parts import Parts, parts
from service.problems import TYPES, Problem, documented
from service.views import Health, ProblemTypeView, Scenes, SceneView, Workers

router = APIRouter(tags=["farm"])


@router.get("/v1/workers", responses=documented())
def workers(farm: Annotated[Parts, Depends(parts)]) -> Workers:
    """List the workers that live, and what each renders."""
    return Workers(workers=farm.jobs.workers())


_WorkerId = Annotated[str, Path(description="the worker's `id`", examples=[examples.WORKER["id"]])]
_STEERING = documented(problems.UNKNOWN_WORKER)


@router.post("/v1/workers/{worker_id}/drain", status_code=202, responses=_STEERING)
def drain(worker_id: _WorkerId, farm: Annotated[Parts, Depends(parts)], by: CallerOf) -> Workers:
    """Tell a worker to take no more slices; what it has in hand it finishes.

    It lives on, idle, and may be stopped without a loss. Doing it again is harmless, and `resume`
    takes it back. Where the API wants keys, it takes an admin's. Answers all workers.
    """
    by.check_may_steer_workers()
    farm.workers.drain(worker_id)
    return Workers(workers=farm.jobs.workers())


@router.post("/v1/workers/{worker_id}/resume", status_code=202, responses=_STEERING)
def let_work(worker_id: _WorkerId, farm: Annotated[Parts, Depends(parts)], by: CallerOf) -> Workers:
    """Let a drained worker take slices again; harmless where it is not. Answers all workers."""
    by.check_may_steer_workers()
    farm.workers.resume(worker_id)
    return Workers(workers=farm.jobs.workers())


@router.get("/v1/scenes", responses=documented())
def scenes(farm: Annotated[Parts, Depends(parts)]) -> Scenes:
    """List the stored scenes; a job can be made from one by its SHA-256."""
    return Scenes(scenes=[SceneView(**scene) for scene in farm.scenes.all()])


@router.get("/healthz")
def live() -> Health:
    """Say that the API runs, whatever else is away."""
    return Health()


@router.get("/readyz", responses=documented())
def ready(farm: Annotated[Parts, Depends(parts)]) -> Health:
    """Say that the API can work: Redis and the blob store answer."""
    farm.jobs.ping()
    farm.blobs.exists("scenes/none")
    return Health()


@router.get(
    "/metrics",
    response_class=Response,
    responses={
        200: {
            "content": {"text/plain": {"schema": {"type": "string"}, "example": examples.METRICS}}
        }
    },
)
def prometheus(request: Request) -> Response:
    """Count the whole farm, and this process's requests, in Prometheus's text format."""
    found: metrics.Metrics = request.app.state.metrics
    return Response(found.exposition(), headers={"Content-Type": metrics.CONTENT_TYPE})


@router.get("/problems/{slug}", responses=documented(problems.UNKNOWN_PATH, store=False))
def problem_type(
    slug: Annotated[str, Path(description="the last part of a `type`", examples=["no-scene"])],
) -> ProblemTypeView:
    """Say what a problem's `type` means."""
    kind = TYPES.get(slug)
    if kind is None:
        raise Problem(problems.UNKNOWN_PATH, f"there is no problem type {slug!r}")
    return ProblemTypeView(type=kind.uri, status=kind.status, title=kind.title)
