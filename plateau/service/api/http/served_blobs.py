"""Blobs as answers: streamed, with the headers that let a client cache and verify them."""

import base64
from itertools import chain
from typing import Any, Final

from fastapi import Response
from fastapi.responses import StreamingResponse

from plateau.farm.model.job import Job
from plateau.service.api.http.etags import NOT_MODIFIED, Known, cache_control, not_modified
from plateau.service.api.parts import Parts
from plateau.service.api.problems import catalogue as problems
from plateau.service.api.problems.catalogue import documented
from plateau.service.api.problems.problem import ProblemType

PNG: Final = "image/png"
EXR: Final = "image/x-exr"
#: The header with the SHA-256 of the file, by which a client verifies it (RFC 9530, section 3).
REPR_DIGEST: Final = "Repr-Digest"
#: The header with an image's samples per pixel.
SPP: Final = "Plateau-Spp"


def serving(media_type: str, *kinds: ProblemType) -> dict[str, Any]:
    """What FastAPI is told of a route that serves a blob of a job: its class, its ``responses``."""
    responses = {
        **file_of(media_type, "ETag", "Cache-Control", "Content-Disposition", REPR_DIGEST, SPP),
        **NOT_MODIFIED,
        **documented(problems.UNKNOWN_JOB, problems.SPOILED_FILE, *kinds),
    }
    return {"response_class": StreamingResponse, "responses": responses}


def file_of(media_type: str, *headers: str) -> dict[int | str, dict[str, Any]]:
    """The OpenAPI ``responses`` of a route that serves a file with these headers."""
    return {
        200: {
            "description": "the file's bytes",
            "content": {media_type: {"schema": {"type": "string", "format": "binary"}}},
            "headers": {name: {"schema": {"type": "string"}} for name in headers},
        }
    }


def headers_of(job: Job, tag: str, file_name: str) -> dict[str, str]:
    """The headers of a file of the job."""
    return {
        "ETag": tag,
        "Cache-Control": cache_control(job),
        "Content-Disposition": f'inline; filename="{file_name}"',
        # Files have a few MB, so ranges would help nobody.
        "Accept-Ranges": "none",
    }


def blob_response(
    blob: str,
    sha256: str | None,
    media_type: str,
    headers: dict[str, str],
    farm: Parts,
    has: Known,
) -> Response:
    """Serve the blob of this SHA-256, or a 304; raises as `StoredFiles.require`."""
    if has.has(headers["ETag"]):
        return not_modified(headers)
    farm.files.require(blob, sha256)
    size = farm.blobs.size(blob)
    if size is None or sha256 is None:  # it has just gone
        raise FileNotFoundError(blob)
    digest = base64.b64encode(bytes.fromhex(sha256)).decode()
    headers = {**headers, "Content-Length": str(size), REPR_DIGEST: f"sha-256=:{digest}:"}
    chunks = farm.blobs.chunks(blob)
    content = chain([next(chunks, b"")], chunks)  # the first is read before the headers are sent
    return StreamingResponse(content, media_type=media_type, headers=headers)
