"""What `POST /v1/jobs` brings: read from the request, checked, stored, made a job.

An upload never sits in memory: the framework spools it to disk as it arrives, it is hashed and
checked there, and goes to the blob store from there.
"""

import hashlib
import os
import re
import secrets
import tempfile
import time
from collections.abc import AsyncIterator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import BinaryIO, Final

from fastapi import Request
from starlette.datastructures import FormData, UploadFile

from farm import blobs as blob_names
from farm.bundle import BundleError, BundleLimits, SceneSummary, inspect_bundle
from farm.jobs import Created
from farm.scene_index import SceneIndex
from farm.spec import BatchSpec, JobSpec
from service import problems
from service.idempotency import idempotency_key
from service.parts import Parts, parts_of
from service.problems import Problem
from service.spec_checks import check_seeds, check_webhook, invalid_field
from service.submitted_spec import submitted_spec

_FIELDS: Final = frozenset({"scene", "scene_sha256", "spec"})
_MAX_SPEC_BYTES: Final = 1 << 20
_MAX_NAME: Final = 90  #: a made-up batch is called by it
#: A scene may take a second to check, and a list has up to a thousand entries.
_MOST_CHECKING_S: Final = 60.0
_CHUNK_BYTES: Final = 1 << 20
_SHA256: Final = re.compile(r"[0-9a-f]{64}")


@dataclass(frozen=True)
class Submission:
    """The parts of a request to create a job."""

    spec: JobSpec | BatchSpec
    idempotency_key: str
    scene: UploadFile | str  #: the upload, or the SHA-256 of a stored scene


async def submission(request: Request) -> AsyncIterator[Submission]:
    """The request's parts, spooled to disk while the route works on them."""
    media_type = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if media_type and media_type != "multipart/form-data":
        raise Problem(
            problems.NOT_MULTIPART,
            f"the body is {media_type}; send multipart/form-data with the parts scene and spec, as "
            "curl -F scene=@scene.zip -F 'spec={}' does",
        )
    try:
        async with request.form(max_files=2, max_fields=8, max_part_size=_MAX_SPEC_BYTES) as form:
            asked = await _submission(form, idempotency_key(request))
            check_webhook(asked.spec, parts_of(request).receivers)
            yield asked
    except OSError as error:
        raise Problem(
            problems.STORE_UNAVAILABLE, f"the upload could not be kept: {error.strerror}"
        ) from error


async def _submission(form: FormData, key: str) -> Submission:
    unknown = sorted(set(form) - _FIELDS)
    if unknown:
        message = f"there is no part {unknown[0]!r}; the parts are scene, scene_sha256 and spec"
        raise invalid_field(problems.INVALID_REQUEST, unknown[0], message)
    return Submission(
        spec=await _spec(form.get("spec")),
        idempotency_key=key,
        scene=_scene(form.get("scene"), form.get("scene_sha256")),
    )


def _scene(upload: UploadFile | str | None, sha256: UploadFile | str | None) -> UploadFile | str:
    if not upload and not sha256:
        raise Problem(
            problems.NO_SCENE,
            "send a Mitsuba XML or a zip of one as the part scene, or the SHA-256 of a stored "
            "scene as the part scene_sha256",
        )
    if upload and sha256:
        message = "send either scene or scene_sha256, not both"
        raise invalid_field(problems.INVALID_REQUEST, "scene_sha256", message)
    if upload:
        if isinstance(upload, str):
            message = "must be a file: curl takes it as -F scene=@FILE, with the @"
            raise invalid_field(problems.INVALID_REQUEST, "scene", message)
        return upload
    if not (isinstance(sha256, str) and _SHA256.fullmatch(sha256)):
        message = "must be 64 lower-case hexadecimal digits"
        raise invalid_field(problems.INVALID_REQUEST, "scene_sha256", message)
    return sha256


async def _spec(part: UploadFile | str | None) -> JobSpec | BatchSpec:
    text = (await part.read(_MAX_SPEC_BYTES)) if isinstance(part, UploadFile) else part
    return submitted_spec(text or b"{}")


@dataclass(frozen=True)
class StoredScene:
    """A scene that passed the check and is stored."""

    sha256: str  #: of the uploaded file
    name: str
    bytes: int  #: size of the uploaded file
    summary: SceneSummary


def store_scene(asked: Submission, farm: Parts) -> StoredScene:
    """What was found in the scene that a request brings or names, checked with the spec's values.

    An upload is stored; a sweep leaves it for an hour at least.
    """
    if isinstance(asked.scene, str):
        name = _name_of_stored(asked.scene, farm.scenes)
        farm.scenes.use(asked.scene)
        with _fetched(asked.scene, farm) as file:
            size = _size(file)
            return StoredScene(asked.scene, name, size, _inspected(file, asked.spec, farm.limits))
    with _on_disk(asked.scene) as file:
        sha256 = _sha256(file)
        summary = _inspected(file, asked.spec, farm.limits)
        size = _size(file)
        farm.scenes.use(sha256)
        farm.blobs.put_once(blob_names.scene(sha256), file, size)
    name = _clean_name(asked.scene.filename)
    farm.scenes.remember(
        sha256, {"name": name, "bytes": size, "width": summary.width, "height": summary.height}
    )
    return StoredScene(sha256, name, size, summary)


def create_job(asked: Submission, farm: Parts, *, owner: str) -> Created:
    """The job that was asked for, its owner's, or the first of many: all of them or none.

    Nothing is created unless the scene passes the check with the values of each. The scene is
    stored before a job exists, so that no worker finds a job without one.
    """
    scene = store_scene(asked, farm)
    sha256, name = scene.sha256, scene.name
    digest = hashlib.sha256(f"{sha256} {asked.spec.as_request()}".encode()).hexdigest()
    return farm.jobs.create_all(
        _job_specs(asked.spec, name),
        name=name,
        scene_sha256=sha256,
        idempotency_key=asked.idempotency_key,
        digest=digest,
        owner=owner,
    )


def _job_specs(spec: JobSpec | BatchSpec, scene: str) -> list[JobSpec]:
    """The spec of each job that is asked for, in a batch of the given name or one made up."""
    if isinstance(spec, JobSpec):
        return [spec]
    stem = scene.rpartition(".")[0] or scene
    return spec.job_specs(spec.batch or f"{stem}-{secrets.token_hex(3)}")


@contextmanager
def _on_disk(upload: UploadFile) -> Iterator[BinaryIO]:
    """The spooled upload as an ordinary file."""
    with os.fdopen(os.dup(upload.file.fileno()), "rb") as file:  # fileno() moves it to disk
        file.seek(0)
        yield file


@contextmanager
def _fetched(sha256: str, farm: Parts) -> Iterator[BinaryIO]:
    with tempfile.TemporaryFile() as file:
        try:
            for chunk in farm.blobs.chunks(blob_names.scene(sha256)):
                file.write(chunk)
        except FileNotFoundError as error:
            farm.scenes.disuse(sha256)
            raise Problem(
                problems.UNKNOWN_SCENE,
                f"no scene {sha256} is stored here; send the file itself as the part scene",
            ) from error
        file.seek(0)
        if _sha256(file) != sha256:
            raise Problem(
                problems.UNKNOWN_SCENE,
                f"the copy of scene {sha256} that is stored here is damaged; remove the blob "
                f"{blob_names.scene(sha256)} and send the file itself as the part scene",
            )
        yield file


def _size(file: BinaryIO) -> int:
    size = file.seek(0, os.SEEK_END)
    file.seek(0)
    return size


def _sha256(file: BinaryIO) -> str:
    digest = hashlib.sha256()
    while chunk := file.read(_CHUNK_BYTES):
        digest.update(chunk)
    file.seek(0)
    return digest.hexdigest()


def _inspected(file: BinaryIO, spec: JobSpec | BatchSpec, limits: BundleLimits) -> SceneSummary:
    """What is found with the spec's values; with the first entry's, where each passes the check."""
    if isinstance(spec, JobSpec):
        return _inspected_once(file, spec, limits)
    summary, known = None, set()
    started = time.monotonic()
    for index, one in enumerate(spec.job_specs("checked")):
        values = frozenset(one.parameter_strings().items())
        if values in known:
            continue
        if time.monotonic() - started > _MOST_CHECKING_S:
            message = f"with {index} entries the scene took {_MOST_CHECKING_S:g} s to check; "
            message += "send fewer at once, each time with the same batch"
            raise invalid_field(problems.INVALID_SPEC, "spec.parameters", message)
        known.add(values)
        found = _inspected_once(file, one, limits, f"spec.parameters.{index}")
        summary = summary or found
    assert summary is not None  # a list has an entry at least
    return summary


def _inspected_once(
    file: BinaryIO, spec: JobSpec, limits: BundleLimits, field: str = ""
) -> SceneSummary:
    """What is found with the values of one job, which are in this field of a list."""
    try:
        summary = inspect_bundle(
            file, parameters=spec.parameter_strings(), sensor=spec.sensor, limits=limits
        )
    except BundleError as error:
        kind = problems.UPLOAD_TOO_LARGE if error.code == "too-large" else problems.BROKEN_SCENE
        problem = Problem(kind, str(error), code=error.code, file=error.file, line=error.line)
        if field:
            problem.detail = f"with {field}: {error}"
            problem.members["errors"] = [{"field": field, "message": str(error)}]
        raise problem from error
    check_seeds(spec, summary.width, summary.height, field or "spec")
    file.seek(0)
    return summary


def _name_of_stored(sha256: str, scenes: SceneIndex) -> str:
    names = (scene["name"] for scene in scenes.all() if scene["sha256"] == sha256)
    return next(names, sha256[:12])


def _clean_name(filename: str | None) -> str:
    """The upload's file name without its folders and what a terminal would not show."""
    last = re.split(r"[/\\]", filename or "")[-1]
    return "".join(letter for letter in last if letter.isprintable())[:_MAX_NAME] or "scene"
