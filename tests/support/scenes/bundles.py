"""Scenes and archives for the tests of bundles."""

import io
import stat
import warnings
import zipfile
from collections.abc import Callable, Mapping


def ply(vertices: str, faces: str, comment: str = "") -> bytes:
    """A mesh in ASCII; vertices and faces are separated by commas."""
    places, polygons = vertices.split(", "), faces.split(", ")
    header = (
        *("ply", "format ascii 1.0", *filter(None, [comment]), f"element vertex {len(places)}"),
        *(f"property float {axis}" for axis in "xyz"),
        *(f"element face {len(polygons)}", "property list uchar int vertex_indices", "end_header"),
    )
    return "\n".join((*header, *places, *polygons, "")).encode()


PLY = ply("0 0 0, 1 0 0, 0 1 0", "3 0 1 2")
#: The least that has the beginning and the end of a PNG.
PNG = b"\x89PNG\r\n\x1a\n\0\0\0\0IEND\xaeB`\x82"
SENSOR = '<sensor type="perspective"/>'


def scene(*body: str, sensor: str = SENSOR) -> bytes:
    """A scene with a sensor, one line for each part of its body, which starts on line 2."""
    lines = [f'<scene version="3.0.0">{sensor}', *body, "</scene>"]
    return "\n".join(lines).encode()


def mesh(filename: str) -> str:
    return f'<shape type="ply"><string name="filename" value="{filename}"/></shape>'


def include(filename: str) -> str:
    return f'<include filename="{filename}"/>'


def zipped(
    files: Mapping[str | zipfile.ZipInfo, bytes | str] | list[tuple[str, bytes]],
    method: int = zipfile.ZIP_DEFLATED,
    forge: Callable[[list[zipfile.ZipInfo]], None] | None = None,
) -> io.BytesIO:
    """An archive; `forge` may change its directory before that is written."""
    stream = io.BytesIO()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # zipfile warns of duplicates
        with zipfile.ZipFile(stream, "w", method) as archive:
            for name, content in files if isinstance(files, list) else files.items():
                archive.writestr(name, content)
            if forge:
                forge(archive.filelist)
    stream.seek(0)
    return stream


def link(name: str, kind: int = stat.S_IFLNK) -> zipfile.ZipInfo:
    """An entry that is a link, or another kind of special file."""
    info = zipfile.ZipInfo(name)
    info.create_system = 3
    info.external_attr = (kind | 0o777) << 16
    return info
