"""The Python client of a Plateau service; docs/client.md has a tour.

>>> from plateau import Client, JobSpec  # doctest: +SKIP
>>> with Client() as client:
...     job = client.submit("scenes:box", JobSpec(max_spp=2000))
...     job = client.wait(job.id)
...     radiance = client.array(job.id)
"""

from plateau.client.client import DEFAULT_URL, Client
from plateau.client.errors import (
    ApiError,
    BadId,
    BadKey,
    BadUrl,
    BrokenScene,
    ClientError,
    Damaged,
    InvalidSpec,
    NoImageYet,
    NotAllowed,
    NotPlateau,
    TimedOut,
    UnknownJob,
    UnknownScene,
    Unreachable,
)
from plateau.client.events import (
    FinishedEvent,
    ImageEvent,
    PointEvent,
    RenderedEvent,
    SliceEvent,
    StateEvent,
    TroubleEvent,
)

__all__ = [
    "DEFAULT_URL",
    "ApiError",
    "BadId",
    "BadKey",
    "BadUrl",
    "BrokenScene",
    "Client",
    "ClientError",
    "Damaged",
    "FinishedEvent",
    "ImageEvent",
    "InvalidSpec",
    "NoImageYet",
    "NotAllowed",
    "NotPlateau",
    "PointEvent",
    "RenderedEvent",
    "SliceEvent",
    "StateEvent",
    "TimedOut",
    "TroubleEvent",
    "UnknownJob",
    "UnknownScene",
    "Unreachable",
]
