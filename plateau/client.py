"""The Python client of a Plateau service.

>>> from plateau.client import Client  # doctest: +SKIP
>>> with Client() as client:
...     job = client.submit(Path("scenes/box"), JobSpec(max_spp=2000))
...     job = client.wait(job.id)
...     client.download(job.id, "image.png", Path("box.png"))
"""

import secrets
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any, Final

import httpx

from farm.job import CurvePoint, Event, LogEntry, Worker
from farm.jobs import BEFORE_ALL_EVENTS
from farm.spec import JobSpec
from farm.states import JobState
from plateau.packing import pack
from plateau.sse import parse_events
from service.views import (
    Curve,
    Happened,
    JobPage,
    JobView,
    Log,
    Scenes,
    SceneView,
    SliceLog,
    Slices,
    SliceView,
    Workers,
)

DEFAULT_URL: Final = "http://127.0.0.1:8713"

#: The service says something every 15 s while a stream of events is open.
_SILENCE_S: Final = 45.0
_FIRST_WAIT_S: Final = 0.25
_LONGEST_WAIT_S: Final = 5.0


class ClientError(Exception):
    """A call to the service did not succeed."""


class Unreachable(ClientError):
    """No service answers at the URL."""


class ApiError(ClientError):
    """The service answered with a problem.

    Attributes
    ----------
    status
        The HTTP status.
    slug
        What kind of problem it is, such as ``unknown-job``.
    problem
        The whole problem, as RFC 9457 describes it.
    """

    def __init__(self, status: int, problem: dict[str, Any]) -> None:
        super().__init__(problem.get("detail") or problem.get("title") or f"HTTP status {status}")
        self.status = status
        self.slug = str(problem.get("type", "")).rpartition("/")[2]
        self.problem = problem


class Client:
    """A Plateau service, as a Python program sees it; may be used from several threads.

    Every method raises `ApiError` where the service answers with a problem, and `Unreachable`
    where nothing answers for `patience_s` seconds.

    Parameters
    ----------
    url
        Where the service is.
    patience_s
        For how long calls that may be repeated are, while the service is away.
    """

    def __init__(self, url: str = DEFAULT_URL, *, patience_s: float = 10.0) -> None:
        self.url = url.rstrip("/")
        self._patience_s = patience_s
        timeout = httpx.Timeout(30.0, connect=5.0, write=120.0)
        # The service is on this machine, or in a tunnel to it: never behind a proxy.
        self._http = httpx.Client(base_url=self.url, timeout=timeout, trust_env=False)

    def __enter__(self) -> "Client":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Give the connections back."""
        self._http.close()

    def submit(
        self, scene: Path | str, spec: JobSpec | None = None, *, idempotency_key: str | None = None
    ) -> JobView:
        """Submit a scene; returns the new job.

        Parameters
        ----------
        scene
            An XML, a zip, a folder with ``scene.xml``; or the SHA-256 of a stored scene.
        spec
            How it is sampled, judged and stopped.
        idempotency_key
            A request with a key that was used already returns the job that it made then. Unset,
            one is made up, so that a repeated attempt of this call makes one job.

        Raises
        ------
        farm.bundle.BundleError
            The scene's files cannot be packed.
        """
        spec = spec or JobSpec()
        headers = {"Idempotency-Key": idempotency_key or secrets.token_hex(16)}
        parts: dict[str, Any] = {"spec": (None, spec.model_dump_json())}

        def send() -> httpx.Response:
            return self._http.post("/v1/jobs", headers=headers, files=parts)

        if isinstance(scene, str):
            parts["scene_sha256"] = (None, scene)
            return JobView.model_validate_json(self._repeat(send).content)
        with pack(scene, spec.parameter_strings()) as packed:
            name = f"{scene.resolve().name}.zip" if scene.is_dir() else packed.name
            parts["scene"] = (name, packed.file, packed.media_type)  # httpx rewinds it each time
            return JobView.model_validate_json(self._repeat(send).content)

    def job(self, job_id: str) -> JobView:
        """The job as it stands."""
        return JobView.model_validate_json(self._get(f"/v1/jobs/{job_id}").content)

    def jobs(
        self,
        *,
        state: JobState | None = None,
        batch: str | None = None,
        cursor: str | None = None,
        limit: int = 50,
    ) -> JobPage:
        """A page of jobs, newest first."""
        asked = {"state": state and state.value, "batch": batch, "cursor": cursor, "limit": limit}
        params = {name: value for name, value in asked.items() if value is not None}
        return JobPage.model_validate_json(self._get("/v1/jobs", params=params).content)

    def curve(self, job_id: str) -> list[CurvePoint]:
        """The points of the job's curve, by rising spp."""
        return Curve.model_validate_json(self._get(f"/v1/jobs/{job_id}/curve").content).points

    def curve_csv(self, job_id: str) -> str:
        """The job's curve as CSV."""
        return self._get(f"/v1/jobs/{job_id}/curve.csv").text

    def slices(self, job_id: str) -> list[SliceView]:
        """The job's ledger, by slice index."""
        return Slices.model_validate_json(self._get(f"/v1/jobs/{job_id}/slices").content).slices

    def log(self, job_id: str) -> list[LogEntry]:
        """How each try of a slice of the job ended, by time."""
        return Log.model_validate_json(self._get(f"/v1/jobs/{job_id}/log").content).entries

    def slice_log(self, job_id: str, index: int) -> SliceLog:
        """The same of one slice, with its line in the ledger."""
        answer = self._get(f"/v1/jobs/{job_id}/slices/{index}/log")
        return SliceLog.model_validate_json(answer.content)

    def workers(self) -> list[Worker]:
        """The workers that live."""
        return Workers.model_validate_json(self._get("/v1/workers").content).workers

    def scenes(self) -> list[SceneView]:
        """The stored scenes."""
        return Scenes.model_validate_json(self._get("/v1/scenes").content).scenes

    def cancel(self, job_id: str) -> JobView:
        """Cancel the job; cancelling it again is harmless."""
        return self._steer(job_id, "cancel")

    def pause(self, job_id: str) -> JobView:
        """Pause the rendering job: slices in hand are finished, no more are taken.

        It may still converge by those slices; pausing it again is harmless.
        """
        return self._steer(job_id, "pause")

    def resume(self, job_id: str) -> JobView:
        """Let the paused job go on; resuming it again is harmless."""
        return self._steer(job_id, "resume")

    def set_priority(self, job_id: str, priority: int) -> JobView:
        """Give the job another priority, -1000 to 1000: higher is served first."""
        path, change = f"/v1/jobs/{job_id}", {"priority": priority}
        answer = self._repeat(lambda: self._http.patch(path, json=change))
        return JobView.model_validate_json(answer.content)

    def image(self, job_id: str, name: str = "image.png") -> bytes:
        """One of the job's images: ``image.png``, ``image.exr`` or ``difference.png``."""
        return self._get(f"/v1/jobs/{job_id}/{name}").content

    def download(self, job_id: str, name: str, path: Path) -> None:
        """Write one of the job's files (``image.exr``, ``slices/3.exr``) whole or not at all."""
        unfinished = path.with_name(f".{path.name}.{secrets.token_hex(4)}")
        try:
            with self._stream(f"/v1/jobs/{job_id}/{name}") as answer, unfinished.open("wb") as file:
                for chunk in answer.iter_bytes():
                    file.write(chunk)
            unfinished.replace(path)
        finally:
            unfinished.unlink(missing_ok=True)

    def events(self, job_id: str, after: str = BEFORE_ALL_EVENTS) -> Iterator[Event]:
        """What happens to the job, as it happens, up to and including ``finished``.

        A connection that breaks is made again, from the last event on.
        """
        last_heard = time.monotonic()
        wait_s = _FIRST_WAIT_S
        while True:
            try:
                with self._stream(f"/v1/jobs/{job_id}/events", after) as answer:
                    if answer.status_code == httpx.codes.NO_CONTENT:
                        return
                    for event in parse_events(answer.iter_lines()):
                        yield event
                        after, last_heard, wait_s = event.id, time.monotonic(), _FIRST_WAIT_S
                        if event.type == "finished":
                            return
                last_heard = time.monotonic()
            except ClientError as error:
                if not _is_away(error) or time.monotonic() - last_heard > self._patience_s:
                    raise
            time.sleep(wait_s)
            wait_s = min(2 * wait_s, _LONGEST_WAIT_S)

    def happened(self, job_id: str) -> list[Event]:
        """What has happened to the job so far."""
        headers = {"Accept": "application/json"}
        answer = self._get(f"/v1/jobs/{job_id}/events", headers=headers)
        return Happened.model_validate_json(answer.content).events

    def wait(self, job_id: str) -> JobView:
        """The job once it is finished: ended, with its results written."""
        for _ in self.events(job_id):
            pass
        return self.job(job_id)

    def _steer(self, job_id: str, what: str) -> JobView:
        path = f"/v1/jobs/{job_id}/{what}"
        return JobView.model_validate_json(self._repeat(lambda: self._http.post(path)).content)

    @contextmanager
    def _stream(self, path: str, last_event_id: str | None = None) -> Iterator[httpx.Response]:
        """A response whose body is read as it comes."""
        headers = {"Last-Event-ID": last_event_id} if last_event_id else {}
        timeout = httpx.Timeout(_SILENCE_S, connect=5.0)
        with (
            _reached(self.url),
            self._http.stream("GET", path, headers=headers, timeout=timeout) as answer,
        ):
            if answer.is_error:
                answer.read()
                raise _api_error(answer)
            yield answer

    def _get(self, path: str, **arguments: Any) -> httpx.Response:
        return self._repeat(lambda: self._http.get(path, **arguments))

    def _repeat(self, send: Callable[[], httpx.Response]) -> httpx.Response:
        """The answer to a request that may be repeated while the service is away."""
        started = time.monotonic()
        wait_s = _FIRST_WAIT_S
        while True:
            try:
                with _reached(self.url):
                    answer = send()
                if answer.is_error:
                    raise _api_error(answer)
            except ClientError as error:
                if not _is_away(error) or time.monotonic() - started > self._patience_s:
                    raise
            else:
                return answer
            time.sleep(wait_s)
            wait_s = min(2 * wait_s, _LONGEST_WAIT_S)


@contextmanager
def _reached(url: str) -> Iterator[None]:
    try:
        yield
    except httpx.TransportError as error:
        raise Unreachable(
            f"no Plateau service answers at {url} ({error}); "
            "start one with `plateau up`, or name it by --url or PLATEAU_URL"
        ) from error


def _api_error(answer: httpx.Response) -> ApiError:
    try:
        problem = answer.json()
    except ValueError:
        problem = None
    return ApiError(answer.status_code, problem if isinstance(problem, dict) else {})


def _is_away(error: ClientError) -> bool:
    """Whether the same call may succeed in a moment."""
    return (
        isinstance(error, Unreachable)
        or getattr(error, "status", None) == httpx.codes.SERVICE_UNAVAILABLE
    )
