"""The API as an ASGI application, made from its parts."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Final

from fastapi import Depends, FastAPI

from farm.allowance import Allowance
from farm.api_keys import ApiKeys
from farm.batches import Batches
from farm.blobs import Blobs
from farm.continuation import Continuations
from farm.jobs import Jobs
from farm.redis_link import RedisClient
from farm.scene_index import SceneIndex
from farm.studies import Studies
from farm.webhooks import Outbox
from farm.workers import Workers
from service import (
    routes_batches,
    routes_continue,
    routes_docs,
    routes_farm,
    routes_images,
    routes_jobs,
    routes_key,
    routes_page,
    routes_previews,
    routes_report,
    routes_results,
    routes_scenes,
    routes_studies,
    routes_webhooks,
)
from service.cut_off import AnswerWhenCutOff
from service.event_hub import EventHub
from service.guards import ENVELOPE_BYTES, BodyLimit, OneLength
from service.head import HeadAsGet
from service.http_metrics import CountRequests
from service.key_guard import Access, KeyGuard
from service.log_fields import LogFields
from service.metrics import Metrics
from service.openapi import DescribedAPI, refuse_unknown_parameters
from service.parts import Parts
from service.point_images import PointImages
from service.problem_handlers import add_problem_handlers
from service.scene_checks import SceneChecks
from service.slashes import KeepSlashes
from service.stored_files import StoredFiles
from service.study_results import StudyResults
from service.version_header import SayVersion
from service.webhook_addresses import Receivers

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
) -> FastAPI:
    """The API over this queue and this blob store.

    Parameters
    ----------
    client, blobs
        Redis and the blob store.
    hub, checks
        The fan-out of events and the checks of scenes, whose limits are the API's; they are closed
        with the app.
    access
        Whether requests need keys.
    webhook_allow
        Networks and host names that are private and may be sent webhooks all the same.
    """

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        yield
        await hub.close()
        points.close()
        checks.close()

    app = DescribedAPI(
        title="Plateau",
        description=_DESCRIPTION,
        version="1",
        lifespan=lifespan,
        dependencies=[Depends(refuse_unknown_parameters)],
        # What a route is called is the operation's id, and so a method of a generated client.
        generate_unique_id_function=lambda route: route.name,
        # A path has one form: a redirect would end an upload by curl in silence.
        redirect_slashes=False,
        # The framework's pages are fetched from elsewhere: see `service.routes_docs`.
        docs_url=None,
        redoc_url=None,
        # A job shows the spec that it was given, so one description serves both ways.
        separate_input_output_schemas=False,
    )
    jobs, studies, points = Jobs(client), Studies(client), PointImages(blobs)
    parts = Parts(
        jobs=jobs,
        scenes=SceneIndex(client),
        batches=Batches(client),
        continuations=Continuations(client),
        studies=studies,
        study_results=StudyResults(studies),
        blobs=blobs,
        files=StoredFiles(blobs, jobs),
        points=points,
        checks=checks,
        hub=hub,
        outbox=Outbox(client),
        workers=Workers(client),
        receivers=Receivers(webhook_allow),
    )
    app.state.parts = parts
    app.state.metrics = Metrics(parts.jobs, blobs)
    add_problem_handlers(app)
    for routes in (
        routes_jobs,
        routes_batches,
        routes_continue,
        routes_results,
        routes_images,
        routes_previews,
        routes_report,
        routes_scenes,
        routes_studies,
        routes_webhooks,
        routes_farm,
        routes_key,
        routes_page,
        routes_docs,
    ):
        app.include_router(routes.router)
    app.webhooks.include_router(routes_webhooks.sent)
    app.add_middleware(KeepSlashes)
    app.add_middleware(HeadAsGet)
    app.add_middleware(BodyLimit, most=checks.limits.max_bytes + ENVELOPE_BYTES)
    app.add_middleware(SayVersion)
    app.add_middleware(KeyGuard, keys=ApiKeys(client), allowance=Allowance(client), access=access)
    app.add_middleware(LogFields)
    app.add_middleware(AnswerWhenCutOff)
    app.add_middleware(OneLength)
    app.add_middleware(CountRequests, requests=app.state.metrics.requests)
    return app
