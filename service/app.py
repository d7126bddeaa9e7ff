"""The API as an ASGI application, made from its parts."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Final

from fastapi import Depends, FastAPI

from farm.blobs import Blobs
from farm.bundle import BundleLimits
from farm.jobs import Jobs
from service import routes_farm, routes_images, routes_jobs, routes_results
from service.event_hub import EventHub
from service.guards import BodyLimit, LocalOnly
from service.head import HeadAsGet
from service.http_metrics import CountRequests
from service.log_fields import LogFields
from service.metrics import Metrics
from service.openapi import DescribedAPI, refuse_unknown_parameters
from service.parts import Parts
from service.problems import add_problem_handlers

#: What a multipart body may have beyond its scene: the spec and the boundaries.
_ENVELOPE_BYTES: Final = 2 << 20

_DESCRIPTION: Final = """
Renders Mitsuba 3 scenes until the eye can no longer tell that more samples were added.

Send a scene to `POST /v1/jobs`, follow `/v1/jobs/{id}/events`, fetch `/v1/jobs/{id}/image.png`.
Every error is a problem as RFC 9457 describes it, with a stable `type`.
"""


def create_app(*, jobs: Jobs, blobs: Blobs, hub: EventHub, max_upload_bytes: int) -> FastAPI:
    """The API over this queue and this blob store.

    Parameters
    ----------
    jobs, blobs, hub
        The queue, the blob store, and the fan-out of events, which is closed with the app.
    max_upload_bytes
        Size of the largest scene that is taken.
    """

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        yield
        await hub.close()

    app = DescribedAPI(
        title="Plateau",
        description=_DESCRIPTION,
        version="1",
        lifespan=lifespan,
        dependencies=[Depends(refuse_unknown_parameters)],
        # A path has one form: a redirect would end an upload by curl in silence.
        redirect_slashes=False,
        # A job shows the spec that it was given, so one description serves both ways.
        separate_input_output_schemas=False,
    )
    app.state.parts = Parts(jobs, blobs, BundleLimits(max_bytes=max_upload_bytes), hub)
    app.state.metrics = Metrics(jobs, blobs)
    add_problem_handlers(app)
    for routes in (routes_jobs, routes_results, routes_images, routes_farm):
        app.include_router(routes.router)
    app.add_middleware(HeadAsGet)
    app.add_middleware(BodyLimit, most=max_upload_bytes + _ENVELOPE_BYTES)
    app.add_middleware(LocalOnly)
    app.add_middleware(LogFields)
    app.add_middleware(CountRequests, requests=app.state.metrics.requests)
    return app
