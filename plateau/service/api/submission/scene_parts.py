"""The scene in a request: an upload, one in a scene root, or one that is stored already."""

import os
import re
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import BinaryIO, Final, TypeAlias, cast

from fastapi import Request
from starlette.datastructures import UploadFile

from plateau.farm.blobs import names as blob_names
from plateau.farm.bundle import BundleError
from plateau.farm.bundle.formats import MITSUBA_XML
from plateau.service.api.parts import Parts
from plateau.service.api.problems import catalogue as problems
from plateau.service.api.problems.problem import Problem
from plateau.service.api.scene_checks.placing import UnreadableFiles

_MOST_PATH: Final = 4096
_SHA256: Final = re.compile(r"[0-9a-f]{64}")


@dataclass(frozen=True)
class ScenePath:
    """The name of a scene in a scene root."""

    text: str

    @property
    def name(self) -> str:
        """What the scene is called: a ``scene.xml`` as its folder is."""
        *folders, last = re.split(r"[/\\]", self.text.rstrip("/\\"))
        return folders[-1] if folders and last == MITSUBA_XML.entry else last


#: An upload, the name of a scene in a scene root, or the SHA-256 of a stored scene.
Scene: TypeAlias = UploadFile | ScenePath | str


def scene_part(
    upload: UploadFile | str | None,
    path: UploadFile | str | None,
    sha256: UploadFile | str | None,
) -> Scene:
    """The one of these parts that a request has."""
    if not upload and not path and not sha256:
        raise Problem(problems.NO_SCENE)
    if sum(map(bool, (upload, path, sha256))) > 1:
        raise Problem(problems.SEVERAL_SCENES, part="scene_sha256" if sha256 else "scene_path")
    if path:
        if not isinstance(path, str) or len(path) > _MOST_PATH or not path.isprintable():
            raise Problem(problems.BAD_SCENE_PATH, most=_MOST_PATH)
        return ScenePath(path)
    if upload:
        if isinstance(upload, str):
            raise Problem(problems.SCENE_NOT_A_FILE)
        return upload
    if not (isinstance(sha256, str) and _SHA256.fullmatch(sha256)):
        raise Problem(problems.BAD_SHA256)
    return sha256


async def placed_file(
    scene: ScenePath, values: Sequence[Mapping[str, str]], request: Request, farm: Parts
) -> BinaryIO:
    """The bundle of a scene in a scene root, with the files for these sets of parameters."""
    if not farm.placing.roots:
        raise Problem(problems.NO_SCENE_ROOTS)
    limits, is_gone = farm.checks.limits, request.is_disconnected
    try:
        return await farm.placing.bundle(scene.text, values, limits, is_gone)
    except BundleError as error:
        raise broken_scene(error) from error
    except UnreadableFiles as error:
        code = "missing-file"
        raise Problem(problems.UNREADABLE_SCENE_FILES, error=error, code=code) from error


def opened(scene: UploadFile | str, farm: Parts) -> BinaryIO:
    """The scene as an ordinary file: the spooled upload, or a fetched copy of a stored scene."""
    if not isinstance(scene, str):
        return os.fdopen(os.dup(scene.file.fileno()), "rb")  # fileno() moves it to disk
    farm.scenes.use(scene)
    with ExitStack() as on_error:
        file = cast("BinaryIO", on_error.enter_context(tempfile.TemporaryFile()))
        try:
            for chunk in farm.blobs.chunks(blob_names.scene(scene)):
                file.write(chunk)
        except FileNotFoundError as error:
            farm.scenes.disuse(scene)
            raise Problem(problems.UNKNOWN_SCENE, sha256=scene) from error
        file.flush()  # another process reads it
        on_error.pop_all()
    return file


def broken_scene(error: BundleError, field: str = "") -> Problem:
    """The problem with a scene, for the values in this field of a list."""
    is_large = error.code == "too-large"
    where = {"error": error, "code": error.code, "file": error.file, "line": error.line}
    if not field:
        return Problem(problems.SCENE_TOO_LARGE if is_large else problems.BROKEN_SCENE, **where)
    return Problem(
        problems.SCENE_TOO_LARGE_WITH if is_large else problems.BROKEN_WITH,
        field=field,
        errors=[{"field": field, "message": str(error)}],
        **where,
    )
