"""The Python client of a Plateau service; docs/client.md has a tour.

>>> from plateau import Client, JobSpec  # doctest: +SKIP
>>> with Client() as client:
...     job = client.submit(Path("scenes/box"), JobSpec(max_spp=2000))
...     job = client.wait(job.id)
...     radiance = client.array(job.id)
"""

from plateau.client.client import DEFAULT_URL, Client
from plateau.client.errors import (
    ApiError,
    BadKey,
    BadUrl,
    ClientError,
    Damaged,
    NotPlateau,
    TimedOut,
    Unreachable,
)
from plateau.client.events import (
    FinishedEvent,
    ImageEvent,
    PointEvent,
    SliceEvent,
    StateEvent,
    TroubleEvent,
)

__all__ = [
    "DEFAULT_URL",
    "ApiError",
    "BadKey",
    "BadUrl",
    "Client",
    "ClientError",
    "Damaged",
    "FinishedEvent",
    "ImageEvent",
    "NotPlateau",
    "PointEvent",
    "SliceEvent",
    "StateEvent",
    "TimedOut",
    "TroubleEvent",
    "Unreachable",
]
