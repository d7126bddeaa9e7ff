"""A bare app on uvicorn and Starlette: it answers with the bytes that it was given.

    python -m bench.support.bare.app < ANSWERS.json

`ANSWERS.json` is an object of texts by name. The app prints its URL once it listens. ``GET /NAME``
answers with the text of that name; ``POST /NAME`` does so after it has read the form; and ``GET
/stream/NAME`` repeatedly sends it as an event, to all clients at the same time.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import sys
import time
from typing import TYPE_CHECKING

import uvicorn
from starlette.applications import Starlette
from starlette.responses import Response, StreamingResponse
from starlette.routing import Route

from plateau.service.api.process import listen, url_of

if TYPE_CHECKING:
    from collections.abc import AsyncIterator

    from starlette.requests import Request

#: Between two events, in seconds.
_PAUSE_S = 0.7


class _Ticker:
    """The time of the last event, for all streams that wait for the next."""

    def __init__(self) -> None:
        self._tick = asyncio.Condition()
        self._number = 0
        self.event_id = ""

    async def run(self) -> None:
        while True:
            await asyncio.sleep(_PAUSE_S)
            async with self._tick:
                self._number += 1
                self.event_id = f"{round(time.time() * 1000)}-0"
                self._tick.notify_all()

    async def wait(self, after: int) -> int:
        async with self._tick:
            await self._tick.wait_for(lambda: self._number > after)
            return self._number


def main() -> None:
    answers: dict[str, str] = json.load(sys.stdin)
    ticker = _Ticker()

    async def answer(request: Request) -> Response:
        if request.method == "POST":
            async with request.form() as form:
                await form["scene"].read()  # type: ignore[union-attr]  # a file, as it was sent
        return Response(answers[request.path_params["name"]], media_type="application/json")

    async def stream(request: Request) -> Response:
        text = answers[request.path_params["name"]]

        async def events() -> AsyncIterator[str]:
            number = 0
            yield "retry: 1000\n\n"
            while True:
                number = await ticker.wait(number)
                yield f"id: {ticker.event_id}\nevent: point\ndata: {text}\n\n"

        return StreamingResponse(events(), media_type="text/event-stream")

    @contextlib.asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        ticking = asyncio.create_task(ticker.run())
        yield
        ticking.cancel()

    app = Starlette(
        routes=[
            Route("/stream/{name}", stream),
            Route("/{name}", answer, methods=["GET", "POST"]),
        ],
        lifespan=lifespan,
    )
    listener = listen("127.0.0.1", 0)
    listener.listen()  # clients that connect before the loop runs wait for it
    print(url_of(listener), flush=True)
    config = uvicorn.Config(app, log_level="warning", access_log=False, timeout_graceful_shutdown=1)
    uvicorn.Server(config).run(sockets=[listener])


if __name__ == "__main__":
    main()
