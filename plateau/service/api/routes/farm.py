"""Routes for the farm itself: workers, scenes, rules, health, and the meaning of problem types."""

from pathlib import PurePosixPath
from typing import Annotated, Any, Final, Literal

from fastapi import APIRouter, Path, Query, Request, Response
from pydantic import BaseModel, ConfigDict, Field, RootModel
from pydantic.config import JsonDict
from pydantic.json_schema import SkipJsonSchema

from plateau.farm.bundle.formats import formats
from plateau.farm.ledger.api_keys import KeyLimits, Role
from plateau.farm.ledger.totals import take_census
from plateau.farm.model.place_names import PlaceName
from plateau.farm.model.spec import JobSpec, RenderVariant
from plateau.farm.wire import examples
from plateau.farm.wire.rule_views import Rules, rules_view
from plateau.farm.wire.views import (
    DemandView,
    Health,
    ProblemTypeView,
    Scenes,
    SceneView,
    Workers,
)
from plateau.service.api.access.callers import CallerOf
from plateau.service.api.metrics import farm as metrics
from plateau.service.api.parts import Farm, Parts
from plateau.service.api.problems import catalogue as problems
from plateau.service.api.problems.catalogue import TYPES, documented
from plateau.service.api.problems.problem import Problem

router = APIRouter(tags=["farm"])


class SpecSchema(RootModel[dict[str, Any]]):
    """A JSON schema (draft 2020-12)."""

    model_config = ConfigDict(
        json_schema_extra={"examples": [{"title": "JobSpec", "type": "object", "properties": {}}]}
    )


_SPEC_SCHEMA: Final = SpecSchema(JobSpec.model_json_schema())


def _all_workers(farm: Parts) -> Workers:
    return Workers(workers=farm.workers.living())


@router.get("/v1/workers", responses=documented())
def list_workers(farm: Farm) -> Workers:
    """List the living workers, and what each renders."""
    return _all_workers(farm)


@router.get("/v1/demand", responses=documented(problems.INVALID_REQUEST))
def get_demand(
    farm: Farm,
    variant: Annotated[
        list[RenderVariant],
        Query(
            description="count slices for workers that have one of these; none: for any worker",
            examples=[["llvm_ad_rgb", "scalar_rgb"]],
        ),
    ] = [],  # noqa: B006  (FastAPI copies it)
    pool: Annotated[
        PlaceName | SkipJsonSchema[None],  # no query has a null
        Query(description="and that are in this pool; omitted: in any", examples=["night"]),
    ] = None,
    tag: Annotated[
        list[PlaceName | Literal[""]] | SkipJsonSchema[None],
        Query(
            description="and that have these tags, or none (`tag=`); omitted: any tags",
            examples=[["highmem"]],
        ),
    ] = None,
) -> DemandView:
    """Say how many slices need a worker, for autoscalers.

    While a job is far from its end, more slices are planned than the farm has workers, so a farm
    that follows `slices` grows to its limits. The number falls as the end comes near, and is 0 for
    an idle farm.
    """
    wanted = take_census(farm.redis).demand_for(variant, pool=pool, tags=tag)
    return DemandView(slices=wanted.slices, waiting=wanted.waiting, leased=wanted.leased)


_WorkerId = Annotated[str, Path(description="the worker's `id`", examples=[examples.WORKER["id"]])]
_STEERING = documented(problems.UNKNOWN_WORKER)


@router.post("/v1/workers/{worker_id}/drain", status_code=202, responses=_STEERING)
def drain_worker(worker_id: _WorkerId, farm: Farm, by: CallerOf) -> Workers:
    """Tell a worker to finish its slice and take no more.

    It stays alive, idle, and may be stopped without a loss. Repeating it is harmless; `resume`
    undoes it. If the API demands keys, this needs an admin's. The answer lists all workers.
    """
    by.check_may_steer_workers()
    farm.workers.drain(worker_id)
    return _all_workers(farm)


@router.post("/v1/workers/{worker_id}/resume", status_code=202, responses=_STEERING)
def resume_worker(worker_id: _WorkerId, farm: Farm, by: CallerOf) -> Workers:
    """Let a drained worker take slices again; harmless for others. The answer lists all workers."""
    by.check_may_steer_workers()
    farm.workers.resume(worker_id)
    return _all_workers(farm)


@router.get("/v1/scenes", responses=documented())
def list_scenes(farm: Farm) -> Scenes:
    """List the stored scenes, from which jobs can be made by their SHA-256, and the scene roots."""
    return Scenes(
        scenes=[SceneView(**scene) for scene in farm.scenes.all()],
        roots=[root.name for root in farm.placing.roots],
        formats={PurePosixPath(one.entry).suffix: one.called for one in formats()},
    )


@router.get("/v1/rules", responses=documented(store=False))
def list_rules() -> Rules:
    """List the stopping rules that a job can name, with what a form needs to show them."""
    return rules_view()


@router.get("/v1/spec", responses=documented(store=False))
def get_spec_schema() -> SpecSchema:
    """Show the JSON schema of a job's spec: its fields with their defaults, bounds and meaning.

    Forms can be made from it, and editors can check specs by it. `POST /v1/jobs` also checks how
    fields go together.
    """
    return _SPEC_SCHEMA


@router.get("/healthz")
def get_health() -> Health:
    """Say that the API runs, even if Redis or the blob store is away."""
    return Health()


@router.get("/readyz", responses=documented())
def get_readiness(farm: Farm) -> Health:
    """Say that the API can work: Redis and the blob store answer."""
    farm.redis.ping()
    farm.blobs.size("scenes/none")
    return Health()


@router.get(
    "/metrics",
    response_class=Response,
    responses={
        200: {
            "content": {"text/plain": {"schema": {"type": "string"}, "example": examples.METRICS}}
        },
        **documented(),
    },
)
def get_metrics(request: Request) -> Response:
    """Show the metrics of the farm, and of this process's requests, in Prometheus's text format."""
    found: metrics.Metrics = request.app.state.metrics
    return Response(found.exposition(), headers={"Content-Type": metrics.CONTENT_TYPE})


@router.get("/problems/{slug}", responses=documented(problems.UNKNOWN_PATH, store=False))
def get_problem_type(
    slug: Annotated[str, Path(description="the last part of a `type`", examples=["no-scene"])],
) -> ProblemTypeView:
    """Say what a problem's `type` means."""
    kind = TYPES.get(slug)
    if kind is None:
        raise Problem(problems.NO_SUCH_PROBLEM, slug=slug)
    return ProblemTypeView(type=kind.uri, status=kind.status, title=kind.title)


_KEY: Final[JsonDict] = {
    "id": examples.KEY_ID,
    "name": "nightly",
    "role": "submitter",
    "limits": {
        "upload_bytes": 500_000_000,
        "open_jobs": 10_000,
        "scenes_bytes": 53_687_091_200,
    },
}


class KeyView(BaseModel):
    """The key that a request came with."""

    model_config = ConfigDict(json_schema_extra={"examples": [_KEY]})

    id: str | None = Field(description="`owner` of the jobs that it makes; null without a key")
    name: str | None
    role: Role = Field(description="what the caller may do; `admin` if the service is open")
    limits: KeyLimits | None = Field(description="null without a key")


@router.get("/v1/key", responses=documented())
def get_key(who: CallerOf) -> KeyView:
    """Show what the request's key may do; in an open service, anybody may do everything."""
    if who.key is None:
        return KeyView(id=None, name=None, role=Role.ADMIN, limits=None)
    return KeyView(id=who.key.id, name=who.key.name, role=who.key.role, limits=who.key.limits)
