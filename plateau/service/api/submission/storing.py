"""Stores the scene of a submission, once it is checked and within the key's quota.

It is checked with the values of each job that is to render it.
"""

import os
import re
from dataclasses import dataclass
from functools import partial
from typing import Annotated, BinaryIO, Final

from fastapi import Depends, Request
from fastapi.concurrency import run_in_threadpool
from starlette.datastructures import UploadFile
from starlette.exceptions import HTTPException

from plateau.farm.blobs import names as blob_names
from plateau.farm.bundle import BundleError, SceneSummary
from plateau.farm.bundle.hashes import sha256_of
from plateau.farm.bundle.placed import LIST_NAME
from plateau.farm.ledger.scene_index import SceneIndex
from plateau.farm.model.renderers import variant_for
from plateau.farm.model.spec import BatchSpec, JobSpec
from plateau.service.api.access.callers import Caller, CallerOf
from plateau.service.api.parts import Farm, Parts
from plateau.service.api.problems import catalogue as problems
from plateau.service.api.problems.problem import Problem
from plateau.service.api.problems.spec_checks import check_film_sizes, check_size
from plateau.service.api.scene_checks.pool import Check, Gone, TooManyChecks
from plateau.service.api.scene_checks.process import CheckBudget, CheckEnded
from plateau.service.api.submission.reading import Submission, submission
from plateau.service.api.submission.scene_parts import (
    Scene,
    ScenePath,
    broken_scene,
    opened,
    placed_file,
)

_MAX_NAME: Final = 90  #: leaves room for the suffix of a generated batch name


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
            values = [one.parameter_strings() for one in different(asked.spec).values()]
            with await placed_file(asked.scene, values, request, farm) as file:
                async with farm.checks.slot(request.is_disconnected) as check:
                    return await _checked_and_stored(check, file, asked, farm, who)
        async with farm.checks.slot(request.is_disconnected) as check:
            with await run_in_threadpool(opened, asked.scene, farm) as file:
                return await _checked_and_stored(check, file, asked, farm, who)
    except (TooManyChecks, CheckEnded) as error:
        raise Problem(problems.BUSY) from error
    except Gone:
        raise HTTPException(problems.CLIENT_GONE) from None


async def _checked_and_stored(
    check: Check, file: BinaryIO, asked: Submission, farm: Parts, who: Caller
) -> StoredScene:
    sha256 = await run_in_threadpool(_sha256, file)
    if isinstance(asked.scene, str) and sha256 != asked.scene:
        blob = blob_names.scene(asked.scene)
        raise Problem(problems.DAMAGED_SCENE, sha256=asked.scene, blob=blob)
    summary = await checked(check, file, asked.spec)
    if summary.roots and isinstance(asked.scene, UploadFile):
        raise Problem(problems.MADE_UP_LIST, name=LIST_NAME, code="entry-name")
    store = partial(_stored, asked.scene, sha256, file, summary, farm, who)
    return await run_in_threadpool(store)


async def checked(check: Check, file: BinaryIO, spec: JobSpec | BatchSpec) -> SceneSummary:
    """Check the file with the values of each entry; returns the summary with the first ones."""
    entries = different(spec)
    asked = [(one.parameter_strings(), one.sensor) for one in entries.values()]
    try:
        found = await check(file, asked)
    except BundleError as error:
        raise broken_scene(error) from error
    if spec.shot is not None:
        check_film_sizes(found.sizes, list(entries))
    if found.summary is not None:
        try:
            summary = found.summary
            variant = variant_for(spec.variant, summary.renderer, is_whole=summary.is_whole)
        except ValueError as error:
            raise Problem(problems.FOREIGN_VARIANT, error=error) from error
    fields = iter(entries)
    for (width, height), entry in zip(found.sizes, entries.values(), strict=False):
        one = entry.model_copy(update={"variant": variant})
        check_size(one, width, height, next(fields) or "spec")
    if found.error is not None:
        raise broken_scene(found.error, next(fields)) from found.error
    if len(found.sizes) < len(asked):
        entries_checked = next(fields).rpartition(".")[2]
        raise Problem(problems.SLOW_TO_CHECK, entries=entries_checked, seconds=CheckBudget.total_s)
    assert found.summary is not None  # a spec has at least one entry
    return found.summary


def different(spec: JobSpec | BatchSpec) -> dict[str, JobSpec]:
    """The spec of each job by the field with its values; of equal ones only the first."""
    if isinstance(spec, JobSpec):
        return {"": spec}
    different: dict[frozenset[tuple[str, str]], tuple[str, JobSpec]] = {}
    for index, one in enumerate(spec.job_specs("checked")):
        values = frozenset(one.parameter_strings().items())
        different.setdefault(values, (f"spec.parameters.{index}", one))
    return dict(different.values())


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
            key=who.name,
            size=size,
            stored_bytes=stored,
            limit_bytes=most,
        )


def _sha256(file: BinaryIO) -> str:
    file.seek(0)
    found = sha256_of(file)
    file.seek(0)
    return found


def _clean_name(filename: str | None) -> str:
    """The upload's file name without folders and unprintable characters."""
    last = re.split(r"[/\\]", filename or "")[-1]
    return "".join(letter for letter in last if letter.isprintable())[:_MAX_NAME] or "scene"
