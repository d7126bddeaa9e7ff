"""The common part of every family's build: parameters, film, files and noise."""

from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt

from plateau.scenes.mesh import Mesh


def numbers(vector: Iterable[float]) -> str:
    """Return numbers in the form of an XML attribute."""
    return ", ".join(f"{number:g}" for number in vector)


def document(
    family: str,
    contents: str,
    *,
    bright: float,
    dim: float,
    field_of_view_deg: float,
    origin: str,
    target: str,
) -> str:
    """Return a family's XML, with the path tracer, the film and the parameters of all families.

    Parameters
    ----------
    family
        Its folder's name.
    contents
        Materials, shapes and lights, as elements four spaces in.
    bright, dim
        Values of `intensity` of its first and of its second scene.
    field_of_view_deg, origin, target
        Of the camera, whose up is y; a point is three numbers separated by commas.
    """
    name = family.upper()
    return f"""\
<?xml version="1.0" encoding="utf-8"?>
<!-- Built by scenes/{family}/build.py; change it there.

     {name} 1, the bright one: intensity = {bright:g} (the default).
     {name} 2, the dim one:    intensity = {dim:g}. -->
<scene version="3.0.0">
    <default name="width" value="512"/>
    <default name="height" value="512"/>
    <default name="intensity" value="{bright:g}"/>
    <default name="max_depth" value="8"/>

    <integrator type="path">
        <integer name="max_depth" value="$max_depth"/>
    </integrator>

    <sensor type="perspective">
        <float name="fov" value="{field_of_view_deg:g}"/>
        <transform name="to_world">
            <lookat origin="{origin}" target="{target}" up="0, 1, 0"/>
        </transform>
        <sampler type="independent"/>
        <film type="hdrfilm">
            <integer name="width" value="$width"/>
            <integer name="height" value="$height"/>
            <rfilter type="box"/>
        </film>
    </sensor>

{contents}</scene>
"""


def shape(identifier: str, mesh: str, bsdf: str) -> str:
    """Return a mesh with one material as a shape."""
    return f"""\
    <shape type="ply" id="{identifier}">
        <string name="filename" value="meshes/{mesh}.ply"/>
        <ref id="{bsdf}"/>
    </shape>"""


def scene_files(
    scene_xml: str, meshes: Mapping[str, Mesh], textures: Mapping[str, bytes]
) -> dict[str, bytes]:
    """Return every file of a scene by its path in the scene's folder."""
    return {
        "scene.xml": scene_xml.encode("utf-8"),
        **{f"meshes/{name}": mesh.to_ply() for name, mesh in meshes.items()},
        **{f"textures/{name}": content for name, content in textures.items()},
    }


def write_files(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write files into a folder, making the folders that they need."""
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)


def noise(shape: tuple[int, int], cells: tuple[int, int], seed: int) -> npt.NDArray[np.float64]:
    """Return smooth noise in [0, 1] that repeats at the edges, on a lattice of so many cells."""
    field = np.random.default_rng(seed).random(cells)
    for axis in (0, 1):
        position = np.arange(shape[axis]) * cells[axis] / shape[axis]
        cell = np.floor(position).astype(int)
        part = position - cell
        part = (part * part * (3 - 2 * part)).reshape((-1, 1) if axis == 0 else (1, -1))
        here = np.take(field, cell % cells[axis], axis)
        there = np.take(field, (cell + 1) % cells[axis], axis)
        field = here + part * (there - here)
    return field
