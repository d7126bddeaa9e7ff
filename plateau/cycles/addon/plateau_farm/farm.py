# SPDX-License-Identifier: Apache-2.0
"""A farm's REST API, by Python's standard library alone: Blender's Python has no other."""

import http.client
import json
import secrets
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

_TIMEOUT_S = 60.0
_CHUNK_BYTES = 1 << 20


class _Stays(urllib.request.HTTPRedirectHandler):
    """Follows no redirect: a POST would become a GET, and the key go to another machine."""

    def redirect_request(self, *_: Any) -> None:
        """Let the answer be an error."""


#: Nor does it ask a proxy of the environment.
_OPENER = urllib.request.build_opener(urllib.request.ProxyHandler({}), _Stays)


class FarmError(Exception):
    """The farm refused, or cannot be reached; the message says why, in words for users."""


class NotThere(FarmError):
    """The farm has no such thing, or not yet."""


class Farm:
    """The farm at a URL, for the holder of a key ("" where it asks for none)."""

    def __init__(self, url: str, key: str = "") -> None:
        parts = urllib.parse.urlsplit(url.strip())
        if parts.scheme not in ("http", "https") or not parts.hostname:
            raise FarmError(f"the farm's URL is {url!r}; it looks like http://queue:8713")
        self.url = url.strip().rstrip("/")
        self.is_this_machine = parts.hostname in ("localhost", "127.0.0.1", "::1")
        self._headers = {"Authorization": f"Bearer {key.strip()}"} if key.strip() else {}

    def submit(
        self, scene: Path, spec: dict[str, Any], tell: Callable[[float], None]
    ) -> dict[str, Any]:
        """Upload a scene, and return the job that was made of it.

        `tell` is told which share of the file has been sent.
        """
        boundary = secrets.token_hex(16)
        head = (
            f"--{boundary}\r\n"
            'Content-Disposition: form-data; name="spec"\r\n\r\n'
            f"{json.dumps(spec)}\r\n--{boundary}\r\n"
            'Content-Disposition: form-data; name="scene"; filename="scene.blend"\r\n'
            "Content-Type: application/octet-stream\r\n\r\n"
        ).encode()
        tail = f"\r\n--{boundary}--\r\n".encode()
        size = scene.stat().st_size

        def parts() -> Iterator[bytes]:
            yield head
            sent = 0
            with scene.open("rb") as file:
                while chunk := file.read(_CHUNK_BYTES):
                    yield chunk
                    sent += len(chunk)
                    tell(sent / size)
            yield tail

        headers = {
            "Content-Type": f"multipart/form-data; boundary={boundary}",
            "Content-Length": str(len(head) + size + len(tail)),
        }
        made: dict[str, Any] = json.loads(self._ask("POST", "/v1/jobs", parts(), headers))
        return made

    def job(self, job_id: str) -> dict[str, Any]:
        """Return a job as it is now."""
        found: dict[str, Any] = json.loads(self._ask("GET", f"/v1/jobs/{job_id}"))
        return found

    def image(self, job_id: str, name: str) -> bytes:
        """Return a job's file, such as ``image.png``; raises `NotThere` before there is one."""
        return self._ask("GET", f"/v1/jobs/{job_id}/{name}")

    def cancel(self, job_id: str) -> None:
        """End a job with the image that it has."""
        self._ask("POST", f"/v1/jobs/{job_id}/cancel", b"")

    def _ask(
        self,
        method: str,
        path: str,
        body: bytes | Iterator[bytes] | None = None,
        headers: dict[str, str] | None = None,
    ) -> bytes:
        asked = urllib.request.Request(
            self.url + path,
            data=body,
            headers={**self._headers, **(headers or {})},
            method=method,
        )
        try:
            with _OPENER.open(asked, timeout=_TIMEOUT_S) as answer:
                content: bytes = answer.read()
                return content
        except urllib.error.HTTPError as error:
            with error:
                said = _problem(error)
            raise (NotThere if error.code == 404 else FarmError)(said) from error
        except (OSError, http.client.HTTPException) as error:
            reason = getattr(error, "reason", None) or error
            raise FarmError(f"no answer from {self.url}: {reason}") from error


def _problem(error: urllib.error.HTTPError) -> str:
    """Return what the farm says of a refusal (RFC 9457), in one line."""
    try:
        problem = json.loads(error.read())
        words = str(problem.get("detail") or problem["title"])
    except (OSError, ValueError, KeyError, AttributeError):
        words = f"{error.reason} {error.headers.get('Location') or ''}"
    if error.code == 401:
        words += " (the key is in the add-on's preferences)"
    return " ".join(words.split())
