"""Plateau's front door: the command line, `render` and the Python client.

``plateau.render("scenes:box")`` renders a scene; ``plateau.Client`` talks to a service. A name is
imported when it is first used, so the command line does not wait for modules that it does not need.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from plateau.client import (
        ApiError,
        BadId,
        BrokenScene,
        Client,
        ClientError,
        FinishedEvent,
        ImageEvent,
        NoImageYet,
        NotAllowed,
        PointEvent,
        RenderedEvent,
        SliceEvent,
        StateEvent,
        TimedOut,
        TroubleEvent,
        UnknownJob,
        UnknownScene,
        Unreachable,
    )
    from plateau.farm.model.errors import InvalidSpec
    from plateau.farm.model.spec import (
        ExrSpec,
        FixedSpec,
        JobSpec,
        JodSpec,
        MultipleSpec,
        MyszkowskiSpec,
        NoiseSpec,
        PsnrSpec,
        RelmseSpec,
        ReverseSpec,
        RmseSpec,
        SuccessiveSpec,
        ViewSpec,
        VisibleSpec,
    )
    from plateau.farm.model.states import JobState
    from plateau.rendering.mapped import Mapped
    from plateau.rendering.mapping import map  # noqa: A004
    from plateau.rendering.render import RenderFailed, render
    from plateau.rendering.result import Result

    __version__: str

__all__ = [
    "ApiError",
    "BadId",
    "BrokenScene",
    "Client",
    "ClientError",
    "ExrSpec",
    "FinishedEvent",
    "FixedSpec",
    "ImageEvent",
    "InvalidSpec",
    "JobSpec",
    "JobState",
    "JodSpec",
    "Mapped",
    "MultipleSpec",
    "MyszkowskiSpec",
    "NoImageYet",
    "NoiseSpec",
    "NotAllowed",
    "PointEvent",
    "PsnrSpec",
    "RelmseSpec",
    "RenderFailed",
    "RenderedEvent",
    "Result",
    "ReverseSpec",
    "RmseSpec",
    "SliceEvent",
    "StateEvent",
    "SuccessiveSpec",
    "TimedOut",
    "TroubleEvent",
    "UnknownJob",
    "UnknownScene",
    "Unreachable",
    "ViewSpec",
    "VisibleSpec",
    "__version__",
    "map",
    "render",
]

#: Homes of names that are neither specs nor the client's.
_HOMES: Final = {
    "InvalidSpec": "plateau.farm.model.errors",
    "JobState": "plateau.farm.model.states",
    "Mapped": "plateau.rendering.mapped",
    "RenderFailed": "plateau.rendering.render",
    "Result": "plateau.rendering.result",
    "map": "plateau.rendering.mapping",
    "render": "plateau.rendering.render",
}


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module 'plateau' has no attribute {name!r}")
    if name == "__version__":
        return import_module("plateau.farm.model.versions").plateau()
    of_clients = "plateau.farm.model.spec" if name.endswith("Spec") else "plateau.client"
    home = _HOMES.get(name, of_clients)
    return getattr(import_module(home), name)


def __dir__() -> list[str]:
    return __all__
