"""Plateau's front door: the command line and the Python client.

``from plateau import Client`` is all that most programs need. A name is imported when it is first
used, so the command line does not wait for modules that it does not need.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from plateau.client import (
        ApiError,
        Client,
        ClientError,
        FinishedEvent,
        ImageEvent,
        PointEvent,
        SliceEvent,
        StateEvent,
        TimedOut,
        TroubleEvent,
        Unreachable,
    )
    from plateau.farm.model.spec import (
        ExrSpec,
        FixedSpec,
        JobSpec,
        MultipleSpec,
        MyszkowskiSpec,
        ReverseSpec,
        SuccessiveSpec,
        ViewSpec,
        VisibleSpec,
    )
    from plateau.farm.model.states import JobState

__all__ = [
    "ApiError",
    "Client",
    "ClientError",
    "ExrSpec",
    "FinishedEvent",
    "FixedSpec",
    "ImageEvent",
    "JobSpec",
    "JobState",
    "MultipleSpec",
    "MyszkowskiSpec",
    "PointEvent",
    "ReverseSpec",
    "SliceEvent",
    "StateEvent",
    "SuccessiveSpec",
    "TimedOut",
    "TroubleEvent",
    "Unreachable",
    "ViewSpec",
    "VisibleSpec",
]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module 'plateau' has no attribute {name!r}")
    if name == "JobState":
        home = "plateau.farm.model.states"
    else:
        home = "plateau.farm.model.spec" if name.endswith("Spec") else "plateau.client"
    return getattr(import_module(home), name)


def __dir__() -> list[str]:
    return __all__
