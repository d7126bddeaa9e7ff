"""What every family's build has in common: what its files are, and writing them."""

from collections.abc import Mapping
from pathlib import Path

from scenes.mesh import Mesh


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
