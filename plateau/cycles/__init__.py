"""Blender's Cycles as a renderer, by Blender's Python module `bpy`: an extension.

`bpy` is under the GNU General Public License 3, with which the Apache License 2.0 of these modules
is compatible. Only render children import it, and the modules here that do; nothing of Blender is
part of Plateau. The folder `addon` is Blender's own side, which submits from there.
"""

from pathlib import Path
from typing import Final

from plateau.farm.model.renderers import Program, RendererFacts, VariantFacts

#: The library of a driver without which no variant can work, by the device's name.
_DRIVERS: Final = {
    "optix": "libcuda.so",
    "cuda": "libcuda.so",
    "hip": "libamdhip64.so",
    "oneapi": "libze_loader.so",
}


def _on(device: str) -> VariantFacts:
    is_cpu = device == "cpu"
    return VariantFacts(
        own_name=device,
        seeds="sequences",
        renders_zones=False,
        on_gpu=not is_cpu,
        is_confined=is_cpu,
        works_everywhere=is_cpu,
        driver=_DRIVERS.get(device, ""),
    )


CYCLES: Final = RendererFacts(
    name="cycles",
    variants=tuple(map(_on, ("cpu", *_DRIVERS))),
    help="cycles:cpu, or :optix, :cuda, :hip or :oneapi in its place",
    scenes="plateau.cycles.scene_file:BLEND",
    child="plateau.cycles.renderer:Renderer",
    package="bpy",
    program=Program(
        name="blender",
        arguments=(
            "--background",
            "--factory-startup",
            "--disable-autoexec",
            "--disable-crash-handler",  # a signal ends it, as it ends Python
            "-noaudio",
            "--python-exit-code",
            "1",
            "--python",
            str(Path(__file__).with_name("boot.py")),
        ),
    ),
    missing="Blender is not here; pip install 'plateau[blender]' (Python 3.11 or 3.13), or put a "
    "blender program on the PATH that has this version of Python",
    devices="plateau.cycles.devices",
)
