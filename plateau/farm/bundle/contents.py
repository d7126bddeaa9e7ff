"""Files that are no mesh or no image, and meshes that end Mitsuba's process, found without it.

Mitsuba 3.9.1 trusts the indices of a PLY mesh: one too high reads past the vertices. What it
refuses by itself, with the line that names the file, is left to it.
"""

import os
import re
import warnings
from collections.abc import Iterable, Iterator
from itertools import islice
from typing import IO, Any, Final

import numpy as np
from numpy.typing import NDArray

from plateau.farm.bundle.archive import Archive
from plateau.farm.bundle.limits import MIB, BundleError, shown
from plateau.farm.bundle.magic import BEGINNING_BYTES, what_it_is
from plateau.farm.bundle.references import Reference

#: Of all files, and of one whose text is read at once.
_MOST_BYTES: Final = 256 * MIB
_MOST_AT_ONCE: Final = 16 * MIB
_MOST_LINE: Final = 1024
_ROWS: Final = 2**18  #: that are read at once

#: The types of PLY files, as numpy has them.
_TYPES: Final = dict(
    re.findall(
        r"(\w+)=(\w+)",
        "char=i1 uchar=u1 short=i2 ushort=u2 int=i4 uint=u4 int8=i1 uint8=u1 int16=i2 uint16=u2 "
        "int32=i4 uint32=u4 float=f4 float32=f4 double=f8 float64=f8",
    )
)
_CORNERS: Final = ("vertex_index", "vertex_indices")

_MESHES: Final = ("ply", "obj", "serialized")
_TEXTURES: Final = ("bitmap", "envmap")
_IMAGES: Final = ("a PNG", "a JPEG image", "an OpenEXR")

#: The corners of faces and, of those with three, the vertices.
Faces = Iterator[tuple[NDArray[Any], NDArray[Any]]]


def check_contents(archive: Archive, references: Iterable[Reference]) -> None:
    """Refuse a mesh or an image of an archive that Mitsuba cannot read.

    Raises
    ------
    BundleError
        Names the file, what is wrong with it and what to do.
    """
    held, left = archive.held, _MOST_BYTES
    for one in references:
        size = held.get(one.path, _MOST_BYTES + 1)
        if one.role != "file" or not one.plugin or one.path in archive.checked or size > left:
            continue
        left -= size
        with archive.open(one.path) as stream:
            beginning = stream.read(BEGINNING_BYTES)
            stream.seek(0)
            problem = _not_at_all(what_it_is(beginning), one.plugin)
            try:
                if problem is None and one.plugin == "ply":
                    problem = _of_ply(stream, size)
            except BundleError:
                raise
            except (LookupError, ValueError):
                pass  # it is damaged otherwise, and Mitsuba will say how
        if problem:
            raise BundleError(
                "unreadable-file", f"{shown(one.text)} {problem}", file=one.file, line=one.line
            )
        archive.checked.add(one.path)


def _not_at_all(what: str | None, plugin: str) -> str | None:
    """Return what a file is that no plugin reads, or no mesh or image."""
    if what is None:
        return None
    if what.startswith(("a web page", "a pointer", "empty")):
        return f"is {what}"
    if plugin in _MESHES and not what.startswith("a PLY"):
        return f"is {what.partition(';')[0]}, and no mesh"
    if plugin in _TEXTURES and not what.startswith(_IMAGES):
        what = what.partition(";")[0]
        return f"is {what}, which Mitsuba cannot read: convert it to PNG, JPEG or OpenEXR"
    return None


def _of_ply(stream: IO[bytes], size: int) -> str | None:
    order, (*before, (_, count, fields)) = _ply_header(stream)
    lists = [at for at, (_, *kinds) in enumerate(fields) if len(kinds) > 1]
    others = [kinds for _, _, each in before for _, *kinds in each]
    if (
        len(lists) != 1
        or fields[lists[0]][0] not in _CORNERS
        or max(map(len, others), default=1) > 1
    ):
        return None
    vertices = next((number for name, number, _ in before if name == "vertex"), 0)
    if order:
        stream.seek(sum(n * _row(each).itemsize for _, n, each in before), os.SEEK_CUR)
        faces = _binary_faces(stream, count, fields, lists[0])
    elif size <= _MOST_AT_ONCE:
        ahead = sum(number * len(each) for _, number, each in before)
        faces = _text_faces(stream, ahead, count, len(fields) + 3, lists[0])
    else:
        return None
    done = 0
    for corners, indices in faces:
        if len(odd := (corners != 3).nonzero()[0]):
            return (
                f"has a face of {corners[odd[0]]:.0f} corners (face {done + odd[0]:,}), and faces "
                "must be triangles: triangulate the mesh, and export it again"
            )
        outside = ((indices < 0) | (indices >= vertices)).nonzero()
        if len(outside[0]):
            face, corner = outside[0][0], outside[1][0]
            return (
                f"has {vertices:,} vertices, from 0 on, and face {done + face:,} names vertex "
                f"{indices[face, corner]:.0f}: export the mesh again"
            )
        done += len(corners)
    return None


def _ply_header(stream: IO[bytes]) -> tuple[str, list[tuple[str, int, list[list[str]]]]]:
    """Return the order of bytes, "" for text, and the elements up to the faces.

    Each element has a name, a count, and for each field its name and its type, or two for a list.
    """
    order, elements = "", list[tuple[str, int, list[list[str]]]]()
    for line in islice(iter(lambda: stream.readline(_MOST_LINE), b""), _MOST_LINE):
        match line.decode("latin-1").split():
            case ["format", kind, *_]:
                order = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}[kind]
            case ["element", name, count]:
                elements.append((name, int(count), []))
            case ["property", "list", count, item, name]:
                elements[-1][2].append([name, order + _TYPES[count], order + _TYPES[item]])
            case ["property", kind, name]:
                elements[-1][2].append([name, order + _TYPES[kind]])
            case ["end_header"]:
                faces = [name for name, _, _ in elements].index("face")
                return order, elements[: faces + 1]
    raise ValueError


def _row(fields: list[list[str]]) -> "np.dtype[Any]":
    """The entry of an element in a binary file, where a list has three items."""
    return np.dtype(
        [
            part
            for at, (_, kind, *items) in enumerate(fields)
            for part in ((str(at), kind), *((f"{at} items", one, 3) for one in items))
        ]
    )


def _binary_faces(stream: IO[bytes], count: int, fields: list[list[str]], at: int) -> Faces:
    row = _row(fields)
    while count > 0 and (data := stream.read(min(count, _ROWS) * row.itemsize)):
        rows = np.frombuffer(data, row, len(data) // row.itemsize)
        yield rows[str(at)], rows[f"{at} items"]
        count -= _ROWS


def _text_faces(stream: IO[bytes], ahead: int, count: int, columns: int, at: int) -> Faces:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of what is no number, where the numbers end
        numbers = np.fromstring(stream.read().decode("latin-1"), sep=" ")[ahead:]
    rows = min(count, numbers.size // columns)
    table = numbers[: rows * columns].reshape(rows, columns)
    yield table[:, at], table[:, at + 1 : at + 4]
