"""A scene that is sent to the API, and the problem that it answers with."""

import json
from typing import Any

import httpx

from tests.support.scenes.bundles import scene

FILM = '<film type="hdrfilm"><integer name="width" value="{0}"/><integer name="height" value="9"/>'
BOX = scene(sensor=f'<sensor type="perspective">{FILM.format(16)}</film></sensor>')


def submit(
    http: httpx.Client,
    content: str | bytes | None = BOX,
    spec: dict[str, Any] | str | None = None,
    *,
    filename: str = "box.xml",
    headers: dict[str, str] | None = None,
    **more: str,
) -> httpx.Response:
    files: dict[str, Any] = {name: (None, value) for name, value in more.items()}
    if content is not None:
        files["scene"] = (filename, content)
    if spec is not None:
        files["spec"] = (None, spec if isinstance(spec, str) else json.dumps(spec))
    return http.post("/v1/jobs", files=files, headers=headers)


def problem(answer: httpx.Response, status: int, slug: str) -> dict[str, Any]:
    """The problem in an answer, which has to be of this type."""
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    found: dict[str, Any] = answer.json()
    assert found["type"] == f"/problems/{slug}"
    assert found["status"] == status
    assert found["instance"] == answer.request.url.path
    assert found["title"]
    assert found["detail"]
    return found
