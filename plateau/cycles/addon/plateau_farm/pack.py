# SPDX-License-Identifier: Apache-2.0
"""Packs what a Blender file refers to into it, in a Blender of its own: pack.py FILE.

A user's own session keeps its files outside. The last line on stdout is a JSON list of what cannot
be packed, or is missing.
"""

import json
import os
import sys
from pathlib import Path

import bpy


def _unpacked() -> list[str]:
    """Return the files that are needed besides the open one."""
    images = (
        one
        for one in bpy.data.images
        if one.source in ("FILE", "SEQUENCE", "MOVIE", "TILED") and one.users
    )
    left = [one.filepath for one in images if not one.packed_files]
    for kind in (bpy.data.fonts, bpy.data.libraries):
        left += [
            one.filepath for one in kind if not one.packed_file and one.filepath != "<builtin>"
        ]
    for kind in (bpy.data.volumes, bpy.data.cache_files):
        left += [one.filepath for one in kind if not getattr(one, "packed_file", None)]
    return sorted({os.path.normpath(bpy.path.abspath(path)) for path in left if path})


def main(file: Path) -> None:
    """Pack, and save the file in its place."""
    bpy.ops.wm.open_mainfile(filepath=str(file), load_ui=False, use_scripts=False)
    for pack in (bpy.ops.file.pack_all, bpy.ops.file.pack_libraries):
        try:
            pack()
        except RuntimeError as error:  # a file is missing, which the list has
            print(error)
    left = _unpacked()
    bpy.ops.wm.save_mainfile(filepath=str(file), compress=True)
    print(json.dumps(left), flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[-1]))
