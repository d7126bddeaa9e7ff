"""Routes for the farm itself: workers, scenes, rules, health, and what a problem's type means."""

from typing import Annotated, Final, Literal

from fastapi import APIRouter, Depends, Path, Query, Request, Response
from pydantic import BaseModel, ConfigDict, Field
from pydantic.config import JsonDict
from pydantic.json_schema import SkipJsonSchema

from plateau.farm.ledger.api_keys import KeyLimits, Role
from plateau.farm.model.place_names import PlaceName
from plateau.farm.model.spec import RenderVariant
from plateau.farm.wire import examples
from plateau.farm.wire.rule_views import Rules, rules_view
from plateau.farm.wire.views import DemandView, Health, ProblemTypeView, Scenes, SceneView, Workers
from plateau.service.api.access.callers import CallerOf
from plateau.service.api.metrics import farm as metrics
from plateau.service.api.parts import Parts, parts
from plateau.service.api.problems import problem as problems
from plateau.service.api.problems.problem import TYPES, Problem, documented

router = APIRouter(tags=["farm"])


def _all_workers(farm: Parts) -> Workers:
    workers = farm.jobs.workers()
    return Workers(workers=workers, refused=farm.workers.refused(workers))


@router.get("/v1/workers", responses=documented())
def list_workers(farm: Annotated[Parts, Depends(parts)]) -> Workers:
    """List the workers that live, what each renders, and who was not let in."""
    return _all_workers(farm)


@router.get("/v1/demand", responses=documented(problems.INVALID_REQUEST))
def get_demand(
    farm: Annotated[Parts, Depends(parts)],
    variant: Annotated[
        list[RenderVariant],
        Query(
            description="count what workers are wanted for that render with one of these; none: "
            "what any worker is wanted for",
            examples=[["llvm_ad_rgb", "scalar_rgb"]],
        ),
    ] = [],  # noqa: B006  (FastAPI copies it)
    pool: Annotated[
        PlaceName | SkipJsonSchema[None],  # no query has a null
        Query(description="and are in this pool; left out: in any", examples=["night"]),
    ] = None,
    tag: Annotated[
        list[PlaceName | Literal[""]] | SkipJsonSchema[None],
        Query(
            description="and have these tags, or none (`tag=`); left out: any tags",
            examples=[["highmem"]],
        ),
    ] = None,
) -> DemandView:
    """Say how many slices want a worker, for those who start and stop workers.

    While a job is far from its end, more are planned than there are workers, so a farm that follows
    `slices` grows to its limits; they get fewer as the end comes near, and none want a worker of a
    farm that has nothing to do.
    """
    wanted = farm.jobs.census().demand_for(variant, pool=pool, tags=tag)
    return DemandView(slices=wanted.slices, waiting=wanted.waiting, leased=wanted.leased)


_WorkerId = Annotated[str, Path(description="the worker's `id`", examples=[examples.WORKER["id"]])]
_STEERING = documented(problems.UNKNOWN_WORKER)


@router.post("/v1/workers/{worker_id}/drain", status_code=202, responses=_STEERING)
def drain_worker(
    worker_id: _WorkerId, farm: Annotated[Parts, Depends(parts)], by: CallerOf
) -> Workers:
    """Tell a worker to take no more slices; what it has in hand it finishes.

    It lives on, idle, and may be stopped without a loss. Doing it again is harmless, and `resume`
    takes it back. Where the API wants keys, it takes an admin's. Answers all workers.
    """
    by.check_may_steer_workers()
    farm.workers.drain(worker_id)
    return _all_workers(farm)


@router.post("/v1/workers/{worker_id}/resume", status_code=202, responses=_STEERING)
def resume_worker(
    worker_id: _WorkerId, farm: Annotated[Parts, Depends(parts)], by: CallerOf
) -> Workers:
    """Let a drained worker take slices again; harmless where it is not. Answers all workers."""
    by.check_may_steer_workers()
    farm.workers.resume(worker_id)
    return _all_workers(farm)


@router.get("/v1/scenes", responses=documented())
def list_scenes(farm: Annotated[Parts, Depends(parts)]) -> Scenes:
    """List the stored scenes; a job can be made from one by its SHA-256."""
    return Scenes(scenes=[SceneView(**scene) for scene in farm.scenes.all()])


@router.get("/v1/rules", responses=documented(store=False))
def list_rules() -> Rules:
    """List the stopping rules that a job can name, with what a form needs to ask for them."""
    return rules_view()


@router.get("/healthz")
def get_health() -> Health:
    """Say that the API runs, whatever else is away."""
    return Health()


@router.get("/readyz", responses=documented())
def get_readiness(farm: Annotated[Parts, Depends(parts)]) -> Health:
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
def get_metrics(request: Request) -> Response:
    """Count the whole farm, and this process's requests, in Prometheus's text format."""
    found: metrics.Metrics = request.app.state.metrics
    return Response(found.exposition(), headers={"Content-Type": metrics.CONTENT_TYPE})


@router.get("/problems/{slug}", responses=documented(problems.UNKNOWN_PATH, store=False))
def get_problem_type(
    slug: Annotated[str, Path(description="the last part of a `type`", examples=["no-scene"])],
) -> ProblemTypeView:
    """Say what a problem's `type` means."""
    kind = TYPES.get(slug)
    if kind is None:
        raise Problem(problems.UNKNOWN_PATH, f"there is no problem type {slug!r}")
    return ProblemTypeView(type=kind.uri, status=kind.status, title=kind.title)


_KEY: Final[JsonDict] = {
    "id": examples.KEY_ID,
    "name": "nightly",
    "role": "submitter",
    "limits": {
        "requests_per_minute": 1200,
        "burst": 200,
        "upload_bytes": 500_000_000,
        "open_jobs": 10_000,
        "scenes_bytes": 53_687_091_200,
    },
}


class KeyView(BaseModel):
    """The key that a request came with."""

    model_config = ConfigDict(extra="ignore", json_schema_extra={"examples": [_KEY]})

    id: str | None = Field(description="`owner` of the jobs that it makes; null without a key")
    name: str | None
    role: Role = Field(description="what the caller may do; `admin` where the service is open")
    limits: KeyLimits | None = Field(description="how much; null without a key")


@router.get("/v1/key", responses=documented())
def get_key(who: CallerOf) -> KeyView:
    """Show what the request's key may do; where the service is open, anybody may do all."""
    if who.key is None:
        return KeyView(id=None, name=None, role=Role.ADMIN, limits=None)
    return KeyView(id=who.key.id, name=who.key.name, role=who.key.role, limits=who.key.limits)
