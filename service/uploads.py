"""What `POST /v1/jobs` brings: read from the request, checked, stored, made a job.

An upload never sits in memory: the framework spools it to disk as it arrives, it is hashed and
checked there, and goes to the blob store from there.
"""

import hashlib
import os
import re
import tempfile
from collections.abc import AsyncIterator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import BinaryIO, Final

from fastapi import Request
from pydantic import ValidationError
from starlette.datastructures import FormData, UploadFile

from farm import blobs as blob_names
from farm.blobs import Blobs
from farm.bundle import BundleError, BundleLimits, SceneSummary, inspect_bundle
from farm.jobs import Created, Jobs
from farm.seeds import SeedSchedule, SeedsExhausted
from farm.spec import JobSpec
from service import problems
from service.problems import FieldError, Problem

_FIELDS: Final = frozenset({"scene", "scene_sha256", "spec"})
_MAX_SPEC_BYTES: Final = 1 << 20
_MAX_NAME: Final = 100
_CHUNK_BYTES: Final = 1 << 20
_SHA256: Final = re.compile(r"[0-9a-f]{64}")
_IDEMPOTENCY_KEY: Final = re.compile(r"[\x21-\x7e]{1,255}")


@dataclass(frozen=True)
class Submission:
    """The parts of a request to create a job."""

    spec: JobSpec
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
            yield await _submission(form, request.headers.get("idempotency-key"))
    except OSError as error:
        raise Problem(
            problems.STORE_UNAVAILABLE, f"the upload could not be kept: {error.strerror}"
        ) from error


async def _submission(form: FormData, idempotency_key: str | None) -> Submission:
    unknown = sorted(set(form) - _FIELDS)
    if unknown:
        message = f"there is no part {unknown[0]!r}; the parts are scene, scene_sha256 and spec"
        raise _invalid(problems.INVALID_REQUEST, unknown[0], message)
    if idempotency_key is not None and not _IDEMPOTENCY_KEY.fullmatch(idempotency_key):
        message = "must be 1 to 255 printable ASCII characters without spaces"
        raise _invalid(problems.INVALID_REQUEST, "Idempotency-Key", message)
    return Submission(
        spec=await _spec(form.get("spec")),
        idempotency_key=idempotency_key or "",
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
        raise _invalid(problems.INVALID_REQUEST, "scene_sha256", message)
    if upload:
        if isinstance(upload, str):
            message = "must be a file: curl takes it as -F scene=@FILE, with the @"
            raise _invalid(problems.INVALID_REQUEST, "scene", message)
        return upload
    if not (isinstance(sha256, str) and _SHA256.fullmatch(sha256)):
        message = "must be 64 lower-case hexadecimal digits"
        raise _invalid(problems.INVALID_REQUEST, "scene_sha256", message)
    return sha256


async def _spec(part: UploadFile | str | None) -> JobSpec:
    text = (await part.read(_MAX_SPEC_BYTES)) if isinstance(part, UploadFile) else part
    try:
        return JobSpec.model_validate_json(text or b"{}", strict=True)
    except ValidationError as error:
        errors = [
            FieldError(field=_field(one["loc"]), message=_message(one["type"], one["msg"]))
            for one in error.errors(include_url=False, include_context=False)
        ]
        raise Problem(
            problems.INVALID_SPEC,
            "; ".join(f"{one.field}: {one.message}" for one in errors),
            errors=[one.model_dump() for one in errors],
        ) from error


def _field(location: tuple[int | str, ...]) -> str:
    """The field as the user wrote it: without the branches that the check tried."""
    names = [str(part) for part in location]
    if names[:1] == ["parameters"]:
        names = names[:2]
    if names[:1] == ["rule"]:
        names = names[:1] + names[2:]
    if names[:1] == ["watch"]:
        names = names[:2] + names[3:]
    return ".".join(["spec", *names])


def _message(kind: str, message: str) -> str:
    if kind == "extra_forbidden":
        return "there is no such field; /docs lists those there are"
    return message.removeprefix("Value error, ")


def _invalid(kind: problems.ProblemType, field: str, message: str) -> Problem:
    return Problem(kind, f"{field}: {message}", errors=[{"field": field, "message": message}])


def create_job(asked: Submission, jobs: Jobs, blobs: Blobs, limits: BundleLimits) -> Created:
    """The job that was asked for; nothing is created unless its scene passes the check.

    The scene is stored before the job exists, so that no worker finds a job without one.
    """
    if isinstance(asked.scene, UploadFile):
        with _on_disk(asked.scene) as file:
            sha256 = _sha256(file)
            summary = _inspected(file, asked.spec, limits)
            size = file.seek(0, os.SEEK_END)
            file.seek(0)
            jobs.use_scene(sha256)
            blobs.put_once(blob_names.scene(sha256), file, size)
        name = _clean_name(asked.scene.filename)
        jobs.remember_scene(
            sha256,
            {"name": name, "bytes": size, "width": summary.width, "height": summary.height},
        )
    else:
        sha256 = asked.scene
        name = _name_of_stored(sha256, jobs)
        jobs.use_scene(sha256)
        with _fetched(sha256, jobs, blobs) as file:
            _inspected(file, asked.spec, limits)
    digest = hashlib.sha256(f"{sha256} {asked.spec.model_dump_json()}".encode()).hexdigest()
    created = jobs.create(
        asked.spec,
        name=name,
        scene_sha256=sha256,
        idempotency_key=asked.idempotency_key,
        digest=digest,
    )
    if created.conflict:
        raise Problem(
            problems.KEY_REUSED,
            f"the Idempotency-Key {asked.idempotency_key!r} made job {created.job.id} from another "
            "scene or spec; use a new key for a new job",
            job_id=created.job.id,
        )
    return created


@contextmanager
def _on_disk(upload: UploadFile) -> Iterator[BinaryIO]:
    """The spooled upload as an ordinary file."""
    with os.fdopen(os.dup(upload.file.fileno()), "rb") as file:  # fileno() moves it to disk
        file.seek(0)
        yield file


@contextmanager
def _fetched(sha256: str, jobs: Jobs, blobs: Blobs) -> Iterator[BinaryIO]:
    with tempfile.TemporaryFile() as file:
        try:
            for chunk in blobs.chunks(blob_names.scene(sha256)):
                file.write(chunk)
        except FileNotFoundError as error:
            jobs.disuse_scene(sha256)
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


def _sha256(file: BinaryIO) -> str:
    digest = hashlib.sha256()
    while chunk := file.read(_CHUNK_BYTES):
        digest.update(chunk)
    file.seek(0)
    return digest.hexdigest()


def _inspected(file: BinaryIO, spec: JobSpec, limits: BundleLimits) -> SceneSummary:
    try:
        summary = inspect_bundle(
            file, parameters=spec.parameter_strings(), sensor=spec.sensor, limits=limits
        )
    except BundleError as error:
        kind = problems.UPLOAD_TOO_LARGE if error.code == "too-large" else problems.BROKEN_SCENE
        raise Problem(
            kind, str(error), code=error.code, file=error.file, line=error.line
        ) from error
    _check_seeds(summary, spec)
    file.seek(0)
    return summary


def _check_seeds(scene: SceneSummary, spec: JobSpec) -> None:
    """Refuse a job that would run out of distinct sampler seeds on any worker that may take it."""
    try:
        SeedSchedule(
            # Of the variants that a worker may choose, JIT ones have the most seeds.
            variant="llvm_ad_rgb" if spec.variant == "auto" else spec.variant,
            width=scene.width,
            height=scene.height,
            slice_spp=spec.slice_spp,
            max_spp=spec.max_spp,
            job_seed=spec.seed,
        )
    except SeedsExhausted as error:
        raise _invalid(problems.INVALID_SPEC, "spec", str(error)) from error


def _name_of_stored(sha256: str, jobs: Jobs) -> str:
    names = (scene["name"] for scene in jobs.scenes() if scene["sha256"] == sha256)
    return next(names, sha256[:12])


def _clean_name(filename: str | None) -> str:
    """The upload's file name without its folders and what a terminal would not show."""
    last = re.split(r"[/\\]", filename or "")[-1]
    return "".join(letter for letter in last if letter.isprintable())[:_MAX_NAME] or "scene"
