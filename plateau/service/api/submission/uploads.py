"""Submissions by `POST /v1/jobs`: read from the request, checked, stored, made into jobs.

An upload is never in memory: the framework spools it to disk as it arrives, where it is hashed and
checked, and from where it goes to the blob store.
"""

import hashlib
import os
import re
import secrets
from collections.abc import AsyncIterator, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated, BinaryIO, Final

from fastapi import Depends, Request
from fastapi.concurrency import run_in_threadpool
from starlette.datastructures import FormData, UploadFile
from starlette.exceptions import HTTPException

from plateau.farm.blobs import store as blob_names
from plateau.farm.bundle import BundleError, SceneSummary
from plateau.farm.bundle.placed import LIST_NAME
from plateau.farm.ledger.jobs import Created
from plateau.farm.ledger.scene_index import SceneIndex
from plateau.farm.model.job import Again
from plateau.farm.model.place_names import MOST_TAGS
from plateau.farm.model.renderers import variant_for
from plateau.farm.model.scene_roots import root_tag
from plateau.farm.model.spec import BatchSpec, JobSpec
from plateau.farm.model.spec.whole_slices import changes, fitted
from plateau.service.api.access.callers import Caller, CallerOf
from plateau.service.api.parts import Farm, Parts, parts_of
from plateau.service.api.problems import problem as problems
from plateau.service.api.problems.framework_errors import MOST_FIELD_BYTES, MOST_FIELDS, MOST_FILES
from plateau.service.api.problems.problem import CLIENT_GONE, Problem
from plateau.service.api.problems.spec_checks import (
    check_film_sizes,
    check_seeds,
    check_size,
    invalid_field,
    with_notice,
)
from plateau.service.api.scene_checks.pool import Gone, TooManyChecks, Turn
from plateau.service.api.scene_checks.process import CheckEnded
from plateau.service.api.submission.idempotency import idempotency_key
from plateau.service.api.submission.scene_parts import (
    Scene,
    ScenePath,
    broken_scene,
    opened,
    placed_file,
    scene_part,
)
from plateau.service.api.submission.submitted_spec import submitted_spec

_FIELDS: Final = frozenset({"scene", "scene_path", "scene_sha256", "spec"})
#: What a scene's name ends with and a job's does not.
_SUFFIX: Final = re.compile(r"\.(zip|xml|json)$", re.IGNORECASE)
_MAX_NAME: Final = 90  #: leaves room for the suffix of a generated batch name
#: CPU time of all checks: one may take a second, and a list has up to a thousand entries.
_MOST_CHECKING_S: Final = 60.0
_BUSY_S: Final = 2
_CHUNK_BYTES: Final = 1 << 20


@dataclass(frozen=True)
class Submission:
    """The parts of a request to create a job."""

    spec: JobSpec | BatchSpec  #: in whole slices
    notes: tuple[str, ...]  #: what of it was changed
    idempotency_key: str
    scene: Scene
    again: Again | None = None  #: the job whose scene it is, if one is rendered again


async def submission(request: Request) -> AsyncIterator[Submission]:
    """Yield the request's parts, which stay on disk until the route is done."""
    media_type = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if media_type and media_type != "multipart/form-data":
        raise Problem(
            problems.NOT_MULTIPART,
            f"the body is {media_type}; send multipart/form-data with the parts scene and spec, as "
            "curl -F scene=@scene.zip -F 'spec={}' does",
        )
    try:
        async with request.form(
            max_files=MOST_FILES, max_fields=MOST_FIELDS, max_part_size=MOST_FIELD_BYTES
        ) as form:
            asked = await _submission(form, idempotency_key(request))
            farm = parts_of(request)
            yield replace(asked, spec=with_notice(asked.spec, farm.receivers, farm.targets))
    except OSError as error:
        raise Problem(
            problems.STORE_UNAVAILABLE, f"the upload could not be kept: {error.strerror}"
        ) from error


async def _submission(form: FormData, key: str) -> Submission:
    unknown = sorted(set(form) - _FIELDS)
    if unknown:
        message = (
            f"there is no part {unknown[0]!r}; the parts are scene, scene_path, scene_sha256 and "
            "spec"
        )
        raise invalid_field(problems.INVALID_REQUEST, unknown[0], message)
    part = form.get("spec")
    text = (await part.read(MOST_FIELD_BYTES)) if isinstance(part, UploadFile) else part
    wanted = submitted_spec(text or b"{}")
    spec = fitted(wanted)
    scene = scene_part(form.get("scene"), form.get("scene_path"), form.get("scene_sha256"))
    return Submission(spec, changes(wanted, spec), key, scene)


@dataclass(frozen=True)
class StoredScene:
    """A scene that passed the check and is stored."""

    sha256: str  #: of the uploaded file, or of the bundle that names a scene's files
    name: str
    bytes: int  #: size of that file
    summary: SceneSummary


async def stored_scene(
    request: Request, asked: Annotated[Submission, Depends(submission)], farm: Farm, who: CallerOf
) -> StoredScene:
    """The scene that a request contains or names, checked with the spec's values, and stored.

    A sweep spares it for at least an hour. Few scenes are fetched, hashed and checked at a time.
    """
    try:
        if isinstance(asked.scene, ScenePath):
            values = [one.parameter_strings() for one in _different(asked.spec).values()]
            with await placed_file(asked.scene, values, request, farm) as file:
                async with farm.checks.turn(request.is_disconnected) as turn:
                    return await _checked_and_stored(turn, file, asked, farm, who)
        async with farm.checks.turn(request.is_disconnected) as turn:
            with await run_in_threadpool(opened, asked.scene, farm) as file:
                return await _checked_and_stored(turn, file, asked, farm, who)
    except (TooManyChecks, CheckEnded) as error:
        raise Problem(
            problems.BUSY,
            f"many scenes are being checked already; try again in {_BUSY_S} s",
            headers={"Retry-After": str(_BUSY_S)},
        ) from error
    except Gone:
        raise HTTPException(CLIENT_GONE) from None


async def _checked_and_stored(
    turn: Turn, file: BinaryIO, asked: Submission, farm: Parts, who: Caller
) -> StoredScene:
    sha256 = await run_in_threadpool(_sha256, file)
    if isinstance(asked.scene, str) and sha256 != asked.scene:
        raise Problem(
            problems.UNKNOWN_SCENE,
            f"the copy of scene {asked.scene} that is stored here is damaged; remove the blob "
            f"{blob_names.scene(asked.scene)} and send the file itself as the part scene",
        )
    summary = await _checked(turn, file, asked.spec)
    if summary.roots and isinstance(asked.scene, UploadFile):
        raise Problem(
            problems.BROKEN_SCENE,
            f"the upload has a {LIST_NAME}, which the service alone makes; name a scene in a scene "
            "root as the part scene_path",
            code="entry-name",
        )
    store = partial(_stored, asked.scene, sha256, file, summary, farm, who)
    return await run_in_threadpool(store)


def _stored(
    scene: Scene,
    sha256: str,
    file: BinaryIO,
    summary: SceneSummary,
    farm: Parts,
    who: Caller,
) -> StoredScene:
    """Put the file into the blob store, unless it is there already."""
    size = os.fstat(file.fileno()).st_size
    file.seek(0)  # the check has moved it
    if isinstance(scene, str):
        names = (known["name"] for known in farm.scenes.all() if known["sha256"] == sha256)
        return StoredScene(sha256, next(names, sha256[:12]), size, summary)
    _check_quota(sha256, size, farm.scenes, who)
    farm.scenes.use(sha256)
    farm.blobs.put_once(blob_names.scene(sha256), file, size)
    name = _clean_name(scene.name if isinstance(scene, ScenePath) else scene.filename)
    known = {"name": name, "bytes": size, "width": summary.width, "height": summary.height}
    farm.scenes.remember(sha256, {**known, "owner": who.id})
    return StoredScene(sha256, name, size, summary)


def _check_quota(sha256: str, size: int, scenes: SceneIndex, who: Caller) -> None:
    """Refuse a scene that exceeds the key's quota.

    A scene that is stored already does not count. Concurrent uploads may together exceed the quota,
    but few are stored at a time.
    """
    most = None if who.key is None else who.key.limits.scenes_bytes
    if most is None or scenes.has(sha256):
        return
    stored = scenes.bytes_of(who.id)
    if stored + size > most:
        raise Problem(
            problems.TOO_MANY_SCENES,
            f"the key {who.name!r} has stored {stored:,} bytes of scenes and may store {most:,}; "
            f"this one has {size:,}; ask who runs the service to remove unused ones (`plateau gc "
            "--scenes-unused-for DAYS`)",
            stored_bytes=stored,
            limit_bytes=most,
        )


def create_job(asked: Submission, scene: StoredScene, farm: Parts, *, owner: str) -> Created:
    """Create the job, or the jobs of a list: all of them or none.

    The scene is stored before, so that no worker finds a job without one.
    """
    sha256, called = scene.sha256, _SUFFIX.sub("", scene.name) or scene.name
    source = sha256 if asked.again is None else asked.again.of
    digest = hashlib.sha256(f"{source} {asked.spec.as_request()}".encode()).hexdigest()
    variant = variant_for(asked.spec.variant, scene.summary.renderer)
    needs = {*asked.spec.requires, *map(root_tag, scene.summary.roots)}
    if len(needs) > MOST_TAGS:
        message = f"has {len(needs)} tags, with those of the scene's roots; {MOST_TAGS} are allowed"
        raise invalid_field(problems.INVALID_SPEC, "spec.requires", message)
    specs = _job_specs(asked.spec, called)
    return farm.jobs.create_all(
        [
            one.model_copy(update={"variant": variant, "requires": tuple(sorted(needs))})
            for one in specs
        ],
        name=asked.spec.name or called,
        scene_sha256=sha256,
        idempotency_key=asked.idempotency_key,
        digest=digest,
        owner=owner,
        notes=(*asked.notes, *_which_sensor(asked.spec, scene.summary.sensors)),
        again=asked.again,
    )


def _which_sensor(spec: JobSpec | BatchSpec, sensors: int) -> Iterator[str]:
    """The note on a choice that nobody made."""
    if sensors > 1 and spec.sensor == 0:
        yield (
            f"the scene has {sensors} sensors, and the first is rendered, sensor 0: `sensor` "
            f"(--sensor) chooses another, up to {sensors - 1}"
        )


def _job_specs(spec: JobSpec | BatchSpec, scene: str) -> list[JobSpec]:
    """The spec of each job; those of a list in the batch that it names, or in a generated one."""
    if isinstance(spec, JobSpec):
        return [spec]
    return spec.job_specs(spec.batch or f"{scene}-{secrets.token_hex(3)}")


def _sha256(file: BinaryIO) -> str:
    digest = hashlib.sha256()
    file.seek(0)
    while chunk := file.read(_CHUNK_BYTES):
        digest.update(chunk)
    file.seek(0)
    return digest.hexdigest()


async def _checked(turn: Turn, file: BinaryIO, spec: JobSpec | BatchSpec) -> SceneSummary:
    """Check the file with the values of each entry; returns the summary with the first ones."""
    entries = _different(spec)
    asked = [(one.parameter_strings(), one.sensor) for one in entries.values()]
    try:
        found = await turn.check(file, asked, total_s=_MOST_CHECKING_S)
    except BundleError as error:
        raise broken_scene(error) from error
    if spec.shot is not None:
        check_film_sizes(found.sizes, list(entries))
    if found.summary is not None:
        try:
            variant = variant_for(spec.variant, found.summary.renderer)
        except ValueError as error:
            raise invalid_field(problems.INVALID_SPEC, "spec.variant", str(error)) from error
    fields = iter(entries)
    for (width, height), entry in zip(found.sizes, entries.values(), strict=False):
        one = entry.model_copy(update={"variant": variant})
        field = next(fields) or "spec"
        # Where the size is not known, the seeds do not depend on it.
        check_seeds(one, width or 1, height or 1, field)
        if width and height:
            check_size(one, width, height, field)
    if found.error is not None:
        raise broken_scene(found.error, next(fields)) from found.error
    if len(found.sizes) < len(asked):
        message = (
            f"with {next(fields).rpartition('.')[2]} entries the scene took {_MOST_CHECKING_S:g} s "
            "to check; send fewer at once, each time with the same batch"
        )
        raise invalid_field(problems.INVALID_SPEC, "spec.parameters", message)
    assert found.summary is not None  # a spec has at least one entry
    return found.summary


def _different(spec: JobSpec | BatchSpec) -> dict[str, JobSpec]:
    """The spec of each job by the field with its values; of equal ones only the first."""
    if isinstance(spec, JobSpec):
        return {"": spec}
    different: dict[frozenset[tuple[str, str]], tuple[str, JobSpec]] = {}
    for index, one in enumerate(spec.job_specs("checked")):
        values = frozenset(one.parameter_strings().items())
        different.setdefault(values, (f"spec.parameters.{index}", one))
    return dict(different.values())


def _clean_name(filename: str | None) -> str:
    """The upload's file name without folders and unprintable characters."""
    last = re.split(r"[/\\]", filename or "")[-1]
    return "".join(letter for letter in last if letter.isprintable())[:_MAX_NAME] or "scene"
