"""Meshes and images that Mitsuba cannot read, or that end its process, found without it.

Mitsuba 3.9.1 trusts the indices of PLY and serialized meshes: one too high reads past the vertices.
What it refuses by itself, and says so with the file's name, is left to it.
"""

import os
import re
import struct
import warnings
import zlib
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from itertools import islice, takewhile
from typing import IO, Any, Final

import numpy as np
from numpy.typing import NDArray

from plateau.farm.bundle.archive import Archive
from plateau.farm.bundle.limits import MIB, BundleError, shown
from plateau.farm.bundle.magic import BEGINNING_BYTES, what_it_is
from plateau.farm.bundle.references import Reference

#: Of all files, and of one whose text or whose compressed parts are read at once.
_MOST_BYTES: Final = 256 * MIB
_MOST_AT_ONCE: Final = 16 * MIB
_MOST_LINE: Final = 1024
_MOST_SHAPES: Final = 1000
_MOST_CHANNELS: Final = 1024
_ROWS: Final = 2**18  #: that are read at once
_SERIALIZED: Final = 0x041C

#: The types of PLY files, as numpy has them.
_TYPES: Final = dict(
    re.findall(
        r"(\w+)=(\w+)",
        "char=i1 uchar=u1 short=i2 ushort=u2 int=i4 uint=u4 int8=i1 uint8=u1 int16=i2 uint16=u2 "
        "int32=i4 uint32=u4 float=f4 float32=f4 double=f8 float64=f8",
    )
)
_CORNERS: Final = ("vertex_index", "vertex_indices")

#: Begins the image files that Mitsuba reads and this module does not.
_IMAGES: Final = (b"BM", b"P5", b"P6", b"PF", b"Pf", b"#?")
_USE: Final = "convert it to PNG, JPEG (RGB or grey, 8 bits) or OpenEXR"
#: The channels of an OpenEXR file that Mitsuba takes for colour, with or without A.
_COLOURS: Final = [
    sorted([*colour, *alpha])
    for colour in (["Y"], ["R", "G", "B"], ["X", "Y", "Z"], ["Y", "RY", "BY"])
    for alpha in ([], ["A"])
]
_CUT: Final = "is cut short: export or download it again"

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
                if problem is None and one.plugin in _PROBLEM_OF:
                    problem = _PROBLEM_OF[one.plugin](stream, size)
            except BundleError:
                raise
            except (LookupError, ValueError, struct.error, zlib.error):
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
    if plugin in ("ply", "obj", "serialized") and not what.startswith("a PLY"):
        return f"is {what.partition(';')[0]}, and no mesh"
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
        if problem := _of_indices(indices, vertices, done):
            return problem
        done += len(corners)
    if done < count:
        return f"is cut short: it has {done:,} of {count:,} faces; export or download it again"
    return None


def _of_indices(indices: NDArray[Any], vertices: int, first: int) -> str | None:
    outside = ((indices < 0) | (indices >= vertices)).nonzero()
    if not len(outside[0]):
        return None
    face, corner = outside[0][0], outside[1][0]
    return (
        f"has {vertices:,} vertices, from 0 on, and face {first + face:,} names vertex "
        f"{indices[face, corner]:.0f}: export the mesh again"
    )


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


def _of_serialized(stream: IO[bytes], size: int) -> str | None:
    """Check the meshes of a file in Mitsuba 0.6's format, each of which is compressed by zlib."""
    data = stream.read(_MOST_AT_ONCE) if size <= _MOST_AT_ONCE else b""
    magic, version, shapes = *struct.unpack_from("<HH", data), *struct.unpack("<I", data[-4:])
    table = f"<{min(shapes, len(data))}{'Q' if version > 3 else 'I'}"
    starts = struct.unpack(table, data[-4 - struct.calcsize(table) : -4])
    for start in starts[:_MOST_SHAPES] if magic == _SERIALIZED else ():
        mesh = zlib.decompressobj().decompress(data[start + 4 :], 4 * _MOST_AT_ONCE)
        (flags,) = struct.unpack_from("<I", mesh)
        at = mesh.index(b"\0", 4) + 1 if version > 3 else 4
        vertices, faces = struct.unpack_from("<QQ", mesh, at)
        each = 3 + 3 * bool(flags & 1) + 2 * bool(flags & 2) + 3 * bool(flags & 8)
        at += 16 + vertices * each * (8 if flags & 0x2000 else 4)
        indices = np.frombuffer(mesh[at : at + 12 * faces], "<u4")
        if problem := _of_indices(indices[: indices.size // 3 * 3].reshape(-1, 3), vertices, 0):
            return problem
    return None


def _of_image(stream: IO[bytes], _size: int, *, is_texture: bool = True) -> str | None:
    beginning = stream.read(BEGINNING_BYTES)
    for magic, problem_of in _OF_IMAGES:
        if beginning.startswith(magic):
            stream.seek(len(magic))
            return problem_of(stream)
    if beginning.startswith(_EXR):
        stream.seek(len(_EXR))
        return _of_exr(stream, is_texture=is_texture)
    what = None if beginning.startswith(_IMAGES) else what_it_is(beginning)
    return what and f"is {what.partition(';')[0]}, which Mitsuba cannot read: {_USE}"


def _of_png(stream: IO[bytes]) -> str | None:
    stream.seek(8)
    while len(head := stream.read(8)) == 8:
        length, kind = struct.unpack(">I4s", head)
        if kind == b"IEND":
            return None
        stream.seek(length + 4, os.SEEK_CUR)
    return _CUT


def _of_jpeg(stream: IO[bytes]) -> str | None:
    while len(head := stream.read(4)) == 4:
        mark, kind, length = struct.unpack(">BBH", head)
        if mark != 0xFF or kind == 0xFF:
            return None  # libjpeg looks for the next mark
        if 0xC0 <= kind <= 0xCF and kind not in (0xC4, 0xC8, 0xCC):
            bits, _, _, channels = struct.unpack(">BHHB", stream.read(6).ljust(6, b"\0"))
            if bits != 8:
                return f"is a JPEG of {bits} bits, and Mitsuba reads 8: {_USE}"
            if channels not in (1, 3):
                return f"is a JPEG of {channels} channels, such as CMYK: {_USE}"
            return None
        stream.seek(length - 2, os.SEEK_CUR)
    return _CUT


def _of_exr(stream: IO[bytes], *, is_texture: bool) -> str | None:
    if struct.unpack("<I", stream.read(4).ljust(4, b"\0"))[0] & 0x800:
        return f"is a deep OpenEXR image, which Mitsuba cannot read: {_USE} without depth"
    while name := _text(stream):
        kind, (size,) = _text(stream), struct.unpack("<I", stream.read(4).ljust(4, b"\0"))
        if (name, kind) == ("channels", "chlist"):
            names: list[str] = []
            while len(names) < _MOST_CHANNELS and (channel := _text(stream)):
                names.append(channel)
                stream.seek(16, os.SEEK_CUR)
            # Of a texture, Mitsuba takes colour without A from a layer, or in lower case, too.
            last = sorted(one.rpartition(".")[2].upper() for one in names)
            if sorted(names) in _COLOURS or (is_texture and last in _COLOURS and "A" not in last):
                return None
            listed = ", ".join(names[:8])[:100]
            return (
                f"has the channels {shown(listed)}, and Mitsuba takes R, G, B or Y, with A or "
                "without: save it with these and no others"
            )
        stream.seek(size, os.SEEK_CUR)
    return _CUT


def _text(stream: IO[bytes]) -> str:
    """Read text up to its zero byte."""
    letters = iter(lambda: stream.read(1), b"")
    return b"".join(islice(takewhile(b"\0".__ne__, letters), 255)).decode("latin-1")


_EXR: Final = b"\x76\x2f\x31\x01"
_OF_IMAGES: Final = (
    (b"\x89PNG", _of_png),
    (b"\xff\xd8", _of_jpeg),
)
_PROBLEM_OF: Final[dict[str, Callable[[IO[bytes], int], str | None]]] = {
    "ply": _of_ply,
    "serialized": _of_serialized,
    "bitmap": _of_image,
    "envmap": partial(_of_image, is_texture=False),
}
