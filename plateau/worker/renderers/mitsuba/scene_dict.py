"""Writes a scene given as a dict, as `mitsuba.load_dict` takes it, as an XML with its files.

Mitsuba's own parser and writer do the work (`mitsuba.parser`, of Mitsuba 3.7 and newer). Values in
memory, which they cannot write, become files first: bitmaps and the data of textures (OpenEXR, or
PNG where they have it), the data of volumes (.vol), meshes (PLY). Arrays of Dr.Jit and numpy become
numbers. Trials showed that the parser crashes on None, so each value is checked before.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import mitsuba as mi
import numpy as np

from plateau.farm.bundle import BundleError, known_plugins
from plateau.farm.bundle.plugins import guess

#: The plugins whose value `data`, a tensor, is that of a texture or of a volume.
_TEXTURES: Final = frozenset({"bitmap"})
_VOLUMES: Final = frozenset({"gridvolume"})
#: The type of what is no part of a scene: a folder in which its files are looked up.
_RESOURCES: Final = "resources"
#: Types that stand for something else than a plugin.
_NO_PLUGINS: Final = frozenset({"ref", "rgb", "scene", "spectrum"})
_GAMMA_TYPES: Final = (mi.Struct.Type.UInt8, mi.Struct.Type.UInt16)
#: Makes the resolver of file names.
_FILES: Final[Any] = mi.file_resolver

_MESH: Final = (
    "is a mesh with {}, which no file can hold; write the mesh with write_ply, and give {{'type': "
    "'ply', 'filename': …, 'bsdf': {{…}}}} in its place"
)


def write_scene_dict(scene: Mapping[str, Any], folder: Path) -> Path:
    """Write the scene and all files that it names into an empty folder; returns its XML.

    Parameters
    ----------
    scene
        Its type is ``scene``. Values may be plain, nested dicts, numpy or Dr.Jit arrays of one
        entry, transforms, bitmaps, tensors, volume grids and meshes. Files are looked up as Mitsuba
        does it: in its ``resources``, by Mitsuba's file resolver, then in the working folder.

    Raises
    ------
    BundleError
        ``unwritable-dict``: a value cannot be written; ``missing-file``: there is no such file. The
        message names its place.
    """
    if scene.get("type") != "scene":
        raise _unwritable(
            "the dict", f"has the type {scene.get('type')!r}, not 'scene'; give it 'type': 'scene'"
        )
    if mi.variant() is None:  # Mitsuba has no classes without one
        mi.set_variant("scalar_rgb")
    (made := folder / "made").mkdir()
    plain = _Files(made, tuple(_resources("", scene))).node("", scene)
    config = mi.parser.ParserConfig(str(mi.variant()))
    try:
        state = mi.parser.parse_dict(config, plain)
        (written := folder / "scene").mkdir()
        mi.parser.transform_relocate(config, state, str(written))
        mi.parser.write_file(state, str(written / "scene.xml"))
    except (RuntimeError, TypeError) as error:
        _check_plugins("", plain)
        raise BundleError("unwritable-dict", f"Mitsuba refuses the dict: {error}") from error
    return written / "scene.xml"


def _resources(where: str, node: Mapping[str, Any]) -> Iterator[Path]:
    """The folders in which a dict has files looked up, wherever it names them."""
    for key, value in node.items():
        if not isinstance(value, Mapping):
            continue
        place = f"{where}.{key}".removeprefix(".")
        if value.get("type") != _RESOURCES:
            yield from _resources(place, value)
            continue
        folder = Path(str(_FILES().resolve(str(value.get("path", "")))))
        if not folder.is_dir():
            raise _unwritable(
                place, f"names the folder {str(value.get('path'))!r}, which is not there"
            )
        yield folder


def _check_plugins(where: str, node: Mapping[str, Any]) -> None:
    """Say which plugin of a dict Mitsuba does not have, if it is that which it refuses."""
    if "type" not in node:
        raise _unwritable(where, f"has no 'type'; it has {', '.join(map(repr, node))}")
    plugin, known = str(node["type"]), known_plugins()
    if known and plugin not in known and plugin not in _NO_PLUGINS:
        raise _unwritable(
            where, f"has the type {plugin!r}, which Mitsuba does not have{guess(plugin, known)}"
        )
    for key, value in node.items():
        if isinstance(value, Mapping):
            _check_plugins(f"{where}.{key}".removeprefix("."), value)


class _Files:
    """The plain values of a dict, and the files of the others."""

    def __init__(self, folder: Path, resources: tuple[Path, ...]) -> None:
        self._folder = folder
        self._resources = resources
        self._numbers = itertools.count(1)

    def node(self, where: str, node: Mapping[str, Any]) -> dict[str, Any]:
        """A nested dict with plain values."""
        plain: dict[str, Any] = {}
        for key, value in node.items():
            if not isinstance(key, str):
                raise _unwritable(where or "the dict", f"has the key {key!r}, which is no text")
            if isinstance(value, Mapping) and value.get("type") == _RESOURCES:
                continue
            place = f"{where}.{key}".removeprefix(".")
            file = self._file(place, node.get("type"), key, value)
            if file is not None:
                plain["filename"] = str(file)
            else:
                plain[key] = self._value(place, key, value)
        return plain

    def _value(self, where: str, key: str, value: Any) -> Any:
        if isinstance(value, Mapping):
            return self.node(where, value)
        if isinstance(value, mi.Mesh):
            return self._mesh(where, value)
        if isinstance(value, mi.Object):
            raise _unwritable(
                where,
                f"is a Mitsuba object ({_class_of(value)}), which no file can hold; give the dict "
                "that it was loaded from in its place",
            )
        if isinstance(value, os.PathLike):
            value = os.fspath(value)
        if key == "filename" and isinstance(value, str):
            return self._existing(where, value)
        if isinstance(value, str | bool | int | float):
            return value
        if isinstance(value, list | tuple):
            return [self._value(f"{where}[{place}]", "", one) for place, one in enumerate(value)]
        if "Transform" in type(value).__name__:
            return _transform(where, _numbers(where, value.matrix))
        numbers = _numbers(where, value)
        if numbers.shape in ((4, 4), (3, 3)):
            return _transform(where, numbers)
        if type(value).__name__.startswith("Color") and key != "value":
            return {"type": "rgb", "value": numbers.tolist()}
        return numbers.tolist()  # a number, or a list of them

    def _file(self, where: str, plugin: object, key: str, value: Any) -> Path | None:
        """The file of a value that is written beside the scene; None if it is none of these."""
        if isinstance(value, mi.Bitmap):
            return self._bitmap(value)
        if isinstance(value, mi.VolumeGrid):
            return self._written(value, "vol")
        if key != "data":
            return None
        tensor = np.asarray(value, dtype=np.float32)
        if plugin in _VOLUMES:
            return self._written(mi.VolumeGrid(tensor), "vol")
        if plugin in _TEXTURES:
            return self._bitmap(mi.Bitmap(tensor))
        raise _unwritable(where, f"is a tensor, and {plugin!r} can read none from a file")

    def _existing(self, where: str, name: str) -> str:
        for folder in self._resources:
            if (folder / name).exists():
                return str(folder / name)
        found = str(_FILES().resolve(name))
        if not Path(found).exists():
            folders = ", ".join(map(str, (*self._resources, Path.cwd())))
            slash = "; write / between folders" if "\\" in name else ""
            raise BundleError(
                "missing-file",
                f"{where} names {name!r}, which is not in {folders}: put it there, or give its "
                f"whole path{slash}",
            )
        return found

    def _bitmap(self, bitmap: mi.Bitmap) -> Path:
        """A PNG of the integers that one holds, in sRGB; otherwise an OpenEXR file."""
        if bitmap.srgb_gamma() and bitmap.component_format() in _GAMMA_TYPES:
            return self._written(bitmap, "png")
        exact = bitmap.convert(component_format=mi.Struct.Type.Float32, srgb_gamma=False)
        return self._written(exact, "exr")

    def _written(self, value: Any, suffix: str) -> Path:
        path = self._folder / f"{next(self._numbers)}.{suffix}"
        value.write(str(path))
        return path

    def _mesh(self, where: str, mesh: mi.Mesh) -> dict[str, Any]:
        """A mesh as a PLY file; one that has more than its surface cannot be written."""
        if mesh.is_emitter() or mesh.is_sensor() or mesh.is_medium_transition():
            raise _unwritable(where, _MESH.format("an emitter, sensor or medium"))
        if str(mesh.bsdf()) != str(mi.load_dict({"type": "diffuse"})):
            raise _unwritable(where, _MESH.format("a BSDF of its own"))
        path = self._folder / f"{next(self._numbers)}.ply"
        mesh.write_ply(str(path))
        return {"type": "ply", "filename": str(path), "face_normals": not mesh.has_vertex_normals()}


def _numbers(where: str, value: Any) -> np.ndarray[Any, Any]:
    """The numbers of an array of numpy or Dr.Jit with one entry."""
    if value is None or callable(value):
        raise _unwritable(where, f"is {value!r}, which no scene can have")
    array = np.array(value)
    if array.dtype.kind not in "biuf":
        raise _unwritable(where, f"is a {type(value).__name__}, which no scene can have")
    is_column = type(value).__module__.startswith(("drjit", "mitsuba")) and array.shape[-1:] == (1,)
    return array[..., 0] if is_column else array


def _transform(where: str, matrix: np.ndarray[Any, Any]) -> Any:
    if matrix.shape == (4, 4):
        return mi.ScalarTransform4f(matrix.astype(np.float64))
    if matrix.shape == (3, 3):
        return mi.ScalarTransform3f(matrix.astype(np.float64))
    raise _unwritable(where, "is several transforms, and a scene takes one")


def _class_of(value: mi.Object) -> str:
    return str(value).partition("[")[0].strip() or type(value).__name__


def _unwritable(where: str, problem: str) -> BundleError:
    return BundleError("unwritable-dict", f"{where} {problem}")
