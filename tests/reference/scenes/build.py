"""Builds the binary files of the test scenes: ``python tests/reference/scenes/build.py``.

All are tiny, and the same to the last bit each time with the same libraries.
"""

import struct
import zlib
from pathlib import Path

import numpy as np
import OpenEXR
from PIL import Image

HERE = Path(__file__).parent


def main() -> None:
    rng = np.random.default_rng(20071)
    sky = rng.uniform(0.1, 1.0, (4, 8, 3)).astype(np.float32)
    sky[1, 2] = 20.0  # a small sun: without noise there is nothing to test
    for scene in ("room/images", "noise"):
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        with OpenEXR.File(header, {"RGB": sky}) as image:
            image.write(str(HERE / scene / "sky.exr"))
    tiles = rng.integers(60, 250, (4, 4, 3), dtype=np.uint8)
    Image.fromarray(tiles).save(HERE / "room/images/tiles.png")
    (HERE / "room/meshes/wall.serialized").write_bytes(_serialized_square())


def _serialized_square() -> bytes:
    """Mitsuba's .serialized format, version 4: one mesh of a square in the xy plane."""
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], dtype="<f4")
    uv = ((corners[:, :2] + 1) / 2).astype("<f4")
    triangles = np.array([[0, 1, 2], [0, 2, 3]], dtype="<u4")
    has_texcoords, single_precision = 0x0002, 0x1000
    body = struct.pack("<I", has_texcoords | single_precision) + b"wall\0"
    body += struct.pack("<QQ", len(corners), len(triangles))
    body += corners.tobytes() + uv.tobytes() + triangles.tobytes()
    mesh = struct.pack("<HH", 0x041C, 4) + zlib.compress(body)
    return mesh + struct.pack("<QI", 0, 1)


if __name__ == "__main__":
    main()
