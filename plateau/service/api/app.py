"""The API as an ASGI application, made from its parts."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Final

from fastapi import Depends, FastAPI

from plateau.extensions import extensions
from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.api_keys import ApiKeys
from plateau.farm.ledger.batches import Batches
from plateau.farm.ledger.continuation import Continuations
from plateau.farm.ledger.deletions import Deletions
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.scene_index import SceneIndex
from plateau.farm.ledger.workers import Workers
from plateau.farm.model import versions
from plateau.farm.redis.client import RedisClient
from plateau.service.api.access.guards import ENVELOPE_BYTES, BodyLimit, OneLength
from plateau.service.api.access.key_guard import Access, KeyGuard
from plateau.service.api.event_hub import EventHub
from plateau.service.api.http.layers import (
    AnswerWhenCutOff,
    HeadAsGet,
    KeepSlashes,
    LogFields,
    SayVersion,
)
from plateau.service.api.metrics.farm import Metrics
from plateau.service.api.metrics.requests import CountRequests
from plateau.service.api.openapi import DescribedAPI, refuse_unknown_parameters
from plateau.service.api.parts import Parts
from plateau.service.api.problems.handlers import add_problem_handlers
from plateau.service.api.routes import (
    again,
    batches,
    deletions,
    downloads,
    farm,
    images,
    jobs,
    notices,
    pages,
    results,
    shots,
    submit,
    usage,
)
from plateau.service.api.scene_checks.placing import Placing
from plateau.service.api.scene_checks.pool import SceneChecks
from plateau.service.api.stored_files import StoredFiles
from plateau.service.notices.receivers import Receivers
from plateau.service.notices.targets import Targets

_DESCRIPTION: Final = """
Renders Mitsuba 3 scenes until the eye can no longer tell that more samples were added.

Send a scene to `POST /v1/jobs`, follow `/v1/jobs/{id}/events`, fetch `/v1/jobs/{id}/image.png`.
Every error is a problem as RFC 9457 describes it, with a stable `type`.
"""


def create_app(
    *,
    client: RedisClient,
    blobs: Blobs,
    hub: EventHub,
    checks: SceneChecks,
    access: Access = Access.UNTIL_KEYS,
    webhook_allow: tuple[str, ...] = (),
    targets: Targets | None = None,
    placing: Placing | None = None,
) -> FastAPI:
    """Make the API over this Redis and this blob store; it closes the hub and the checks.

    `webhook_allow` are private networks and host names that may receive notices, and `targets` are
    those that jobs may name.
    """

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        yield
        await hub.close()
        checks.close()

    app = DescribedAPI(
        title="Plateau",
        description=_DESCRIPTION,
        version=versions.plateau(),
        lifespan=lifespan,
        dependencies=[Depends(refuse_unknown_parameters)],
        # A route's name is its operation's id, by which generators name the method of a client.
        generate_unique_id_function=lambda route: route.name,
        # A redirect would silently end an upload by curl.
        redirect_slashes=False,
        # The framework's pages load files from elsewhere; `routes.pages` serves its own.
        docs_url=None,
        redoc_url=None,
        # A job shows the spec that it was given, so one schema describes both.
        separate_input_output_schemas=False,
    )
    parts = Parts(
        redis=client,
        jobs=Jobs(client),
        scenes=SceneIndex(client),
        batches=Batches(client),
        deletions=Deletions(client),
        continuations=Continuations(client),
        blobs=blobs,
        files=StoredFiles(blobs),
        checks=checks,
        hub=hub,
        workers=Workers(client),
        receivers=Receivers(webhook_allow),
        targets=targets or Targets(),
        placing=placing or Placing(),
    )
    app.state.parts = parts
    app.state.metrics = Metrics(client)
    add_problem_handlers(app, pages.unknown_page)
    of_jobs = (submit, jobs, deletions, batches, shots, again, results, images, downloads)
    for routes in (*of_jobs, usage, notices, farm, pages):
        app.include_router(routes.router)
    for extension in extensions("routes"):
        extension.mount(app, client)
    app.webhooks.include_router(notices.sent)
    app.add_middleware(KeepSlashes)
    app.add_middleware(HeadAsGet)
    app.add_middleware(BodyLimit, most=checks.limits.max_bytes + ENVELOPE_BYTES)
    app.add_middleware(SayVersion)
    app.add_middleware(KeyGuard, keys=ApiKeys(client), access=access)
    app.add_middleware(LogFields)
    app.add_middleware(AnswerWhenCutOff)
    app.add_middleware(OneLength)
    app.add_middleware(CountRequests, requests=app.state.metrics.requests)
    return app
