"""A session of Blender with the add-on: opens a file, submits it as the panel does, and waits.

``python FILE BLEND SETTINGS``, with JSON of the farm's ``url`` and ``key``, settings of the scene,
``paint`` to change an image without saving it, and ``cancel`` to cancel once an image has come. The
last line on stdout has what the session shows.
Blender's own settings are in the folder ``BLENDER_USER_RESOURCES``.
"""

import json
import sys
import tempfile
import time
import zipfile
from pathlib import Path
from typing import Any

import bpy

SOURCE = Path(__file__).parents[2] / "plateau" / "cycles" / "addon" / "plateau_farm"
#: As Blender calls an extension that was installed from a file.
ADD_ON = "bl_ext.user_default.plateau_farm"
PATIENCE_S = 240


def main(blend: str, asked: dict[str, Any]) -> None:
    module = _installed()
    bpy.ops.wm.open_mainfile(filepath=blend, load_ui=False)
    preferences = bpy.context.preferences.addons[ADD_ON].preferences
    preferences.url, preferences.key = asked["url"], asked.get("key", "")
    for name, value in asked.get("settings", {}).items():
        setattr(bpy.context.scene.plateau, name, value)
    if asked.get("paint"):
        image = bpy.data.images.new("painted", 4, 4)
        image.use_fake_user, image.pixels[0] = True, 0.5
    found: dict[str, Any] = {"said": [], "previews": 0}
    try:
        found["submitted"] = list(bpy.ops.plateau.submit())
    except RuntimeError as error:  # what an operator reports is raised to a script
        found["error"] = str(error)
        print(json.dumps(found))
        return
    deadline = time.monotonic() + PATIENCE_S
    while module.look() is not None and time.monotonic() < deadline:
        text = module.state()[0]
        if text not in found["said"]:
            found["said"].append(text)
        if bpy.data.images.get("Plateau"):
            found["previews"] += 1
            if asked.get("cancel"):
                bpy.ops.plateau.cancel()
        time.sleep(0.05)
    text, is_error, is_over = module.state()
    found |= {"text": text, "is_error": is_error, "is_over": is_over}
    image = bpy.data.images.get("Plateau")
    if image is not None:
        found |= {"path": image.filepath, "size": list(image.size), "is_float": image.is_float}
        found["mean"] = sum(image.pixels) / len(image.pixels)
    found["packed"] = [one.name for one in bpy.data.images if one.packed_file]
    found["file"] = bpy.data.filepath
    bpy.ops.preferences.addon_disable(module=ADD_ON)
    assert not hasattr(bpy.types.Scene, "plateau")
    print(json.dumps(found))


def _installed() -> Any:
    """Install the add-on as its README says, and return it."""
    with tempfile.TemporaryDirectory() as folder:
        packed = Path(folder) / "plateau_farm.zip"
        with zipfile.ZipFile(packed, "w") as file:
            for one in SOURCE.iterdir():
                if one.is_file():
                    file.write(one, one.name)
        bpy.ops.extensions.package_install_files(
            filepath=str(packed), repo="user_default", enable_on_install=True
        )
    return sys.modules[ADD_ON]


if __name__ == "__main__":
    main(sys.argv[1], json.loads(sys.argv[2]))
