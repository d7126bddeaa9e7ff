"""Which job a request is about, for every line that is logged on its way."""

import re
from typing import Final

from starlette.types import ASGIApp, Receive, Scope, Send

from plateau.farm.process.log import concern

_PATH: Final = re.compile(r"/v1/jobs/([0-9a-f]{12})(?:/slices/(\d{1,9})\b)?")


class LogFields:
    """Gives the lines of a request the job, and the slice, that its path names."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve the request; a task of its own, so that nobody else's lines are concerned."""
        found = _PATH.match(scope["path"]) if scope["type"] == "http" else None
        if found is not None:
            concern(found[1], None if found[2] is None else int(found[2]))
        await self._app(scope, receive, send)
