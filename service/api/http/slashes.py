"""Names of batches in paths: whatever is in them, a slash included, is one segment of the path.

ASGI hands a path on with its percent-encoding undone, so that a slash in a name cannot be told from
one between segments.
"""

from typing import Annotated, Final
from urllib.parse import unquote

from fastapi import Depends, Path
from starlette.types import ASGIApp, Receive, Scope, Send

_BATCHES: Final = "/v1/batches/"


class KeepSlashes:
    """Leaves ``/`` and ``%`` encoded in the segments of a batch's path; all else is decoded."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, to a batch by the path that it came with."""
        if scope["type"] == "http" and scope["path"].startswith(_BATCHES) and "raw_path" in scope:
            raw = scope["raw_path"].partition(b"?")[0].decode("ascii", "replace")
            path = "/".join(_kept(unquote(segment)) for segment in raw.split("/"))
            scope = {**scope, "path": path}
        await self._app(scope, receive, send)


def _kept(segment: str) -> str:
    return segment.replace("%", "%25").replace("/", "%2F")


def _name(
    name: Annotated[
        str,
        Path(
            description="the batch's name, percent-encoded: a `/` in it is `%2F`",
            examples=["exposures"],
        ),
    ],
) -> str:
    return unquote(name)


#: The name of a batch, as a route takes it.
BatchName = Annotated[str, Depends(_name)]
