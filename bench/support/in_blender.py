"""What `bench.blender` has done in processes that import Blender: ``python -m … WHAT …``.

- ``make NAME PATH SIZE``: write the scene of this name, square and of so many pixels a side.
- ``reference BLEND EXR SPP``: render so many samples of a sequence that no job has.
- ``alone BLEND EXR``: render by Cycles' own adaptive sampling and denoiser.
- ``slices BLEND SPP TURNS SLICE_SPP…``: render as slices of some sizes, and the same at once.

The last two print JSON, with the processor's seconds.
"""

from __future__ import annotations

import json
import resource
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import bpy
import numpy as np

from plateau.cycles.renderer import Renderer
from plateau.farm.images.exr import decode_layers, encode_image
from plateau.farm.model.seeds import SEQUENCE_SAMPLES
from plateau.worker.renderers.contract import Load

if TYPE_CHECKING:
    from numpy.typing import NDArray

#: Cycles' defaults.
_THRESHOLD, _MOST_SPP = 0.01, 4096
_REFERENCE_SEQUENCE: Final = 4000


def _empty() -> Any:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.view_settings.view_transform = "Standard"
    bpy.ops.object.camera_add(location=(4, -4, 3), rotation=(1.1, 0, 0.785))
    scene.camera = bpy.context.object
    bpy.ops.object.light_add(type="AREA", location=(1, -1, 3.8))
    bpy.context.object.data.energy = 120
    return scene


def _paint(colour: tuple[float, ...], **inputs: float) -> Any:
    material = bpy.data.materials.new("paint")
    shader = material.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (*colour, 1)
    for name, value in inputs.items():
        shader.inputs[name.replace("_", " ")].default_value = value
    bpy.context.object.data.materials.append(material)
    return material


def glass() -> None:
    """A closed room with a glass ball and a metal one, under a lamp."""
    _empty()
    bpy.ops.mesh.primitive_cube_add(size=1, location=(0, 0, 2), scale=(10, 10, 4))
    _paint((0.7, 0.7, 0.65))
    bpy.ops.mesh.primitive_uv_sphere_add(segments=64, ring_count=32, radius=0.9, location=(0, 0, 1))
    bpy.ops.object.shade_smooth()
    _paint((1, 1, 1), Transmission_Weight=1.0, Roughness=0.0)
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.6, location=(-1.6, 0.8, 0.6))
    bpy.ops.object.shade_smooth()
    _paint((0.9, 0.6, 0.3), Metallic=1.0, Roughness=0.2)


def still() -> None:
    """Things on a table of fine checks, in the light of a lamp and of the sky."""
    scene = _empty()
    scene.world = bpy.data.worlds.new("sky")
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.3, 0.35, 0.5, 1)
    bpy.ops.mesh.primitive_plane_add(size=12)
    material = _paint((0.5, 0.5, 0.5), Roughness=0.5)
    tree = material.node_tree
    checks = tree.nodes.new("ShaderNodeTexChecker")
    checks.inputs["Scale"].default_value = 60
    shader = tree.nodes["Principled BSDF"]
    tree.links.new(checks.outputs["Color"], shader.inputs["Base Color"])
    for place in range(3):
        bpy.ops.mesh.primitive_torus_add(location=(place - 1, place - 1, 0.3), major_radius=0.5)
        _paint((0.8, 0.3 * place, 0.2), Roughness=0.1 + 0.3 * place)


def smoke() -> None:
    """A cube of smoke that is denser here than there, on a floor."""
    _empty()
    bpy.ops.mesh.primitive_plane_add(size=12)
    _paint((0.6, 0.6, 0.6))
    bpy.ops.mesh.primitive_cube_add(size=2, location=(0, 0, 1))
    material = bpy.data.materials.new("smoke")
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    output = nodes.new("ShaderNodeOutputMaterial")
    volume = nodes.new("ShaderNodeVolumePrincipled")
    noise, density = nodes.new("ShaderNodeTexNoise"), nodes.new("ShaderNodeMath")
    density.operation, density.inputs[1].default_value = "MULTIPLY", 5
    links.new(noise.outputs[0], density.inputs[0])
    links.new(density.outputs[0], volume.inputs["Density"])
    links.new(volume.outputs[0], output.inputs["Volume"])
    bpy.context.object.data.materials.append(material)


def make(name: str, path: str, size: str) -> None:
    """Write one of the scenes, square and of this many pixels a side."""
    {"glass": glass, "still": still, "smoke": smoke}[name]()
    render = bpy.context.scene.render
    render.resolution_x = render.resolution_y = int(size)
    bpy.ops.wm.save_as_mainfile(filepath=path)


def reference(blend: str, exr: str, spp: str) -> None:
    """Write an image of many samples."""
    renderer = _loaded(blend)
    film = _film(renderer, int(spp), _REFERENCE_SEQUENCE * SEQUENCE_SAMPLES)
    Path(exr).write_bytes(encode_image(film / np.float32(spp)))


def alone(blend: str, exr: str) -> None:
    """Write what Cycles makes of the scene by itself."""
    renderer = _loaded(blend)
    one = renderer._one
    assert one is not None
    cycles = one.scene.cycles
    cycles.use_sample_subset, cycles.samples = False, _MOST_SPP
    cycles.use_adaptive_sampling, cycles.adaptive_threshold = True, _THRESHOLD
    cycles.use_denoising = one.layer.cycles.use_denoising = True
    one.layer.cycles.pass_debug_sample_count = True
    before = _processor_s()
    written = renderer._written(one, 0, one.height, _MOST_SPP, 0)
    took_s = _processor_s() - before
    layer, found = one.layer.name, decode_layers(written)
    image = np.stack([found[f"{layer}.Combined.{letter}"] for letter in "RGB"], axis=-1)
    Path(exr).write_bytes(encode_image(image.astype(np.float32)))
    share = float(found[f"{layer}.Debug Sample Count.X"].mean())
    print(json.dumps({"spp": share * _MOST_SPP, "processor_s": took_s}))


def slices(blend: str, spp: str, turns: str, *sizes: str) -> None:
    """Tell what slices cost, and what the same samples do at once: the least of some turns."""
    renderer = _loaded(blend)
    one = renderer._one
    assert one is not None
    wanted = int(spp)

    def at_once() -> None:
        renderer._written(one, 0, one.height, wanted, 0)

    def sliced(size: int) -> None:
        for first in range(0, wanted, size):
            _film(renderer, size, first)

    ways: dict[str, Callable[[], None]] = {
        "at once": at_once,
        **{size: partial(sliced, int(size)) for size in sizes},
    }
    took = dict.fromkeys(ways, float("inf"))
    for _ in range(int(turns)):
        for way, work in ways.items():
            before = _processor_s()
            work()
            took[way] = min(took[way], _processor_s() - before)
    print(json.dumps(took))


def _loaded(blend: str) -> Renderer:
    path = Path(blend)
    renderer = Renderer("cpu", 2)
    renderer.load(Load(folder=str(path.parent), entry=path.name, parameters={}))
    return renderer


def _film(renderer: Renderer, spp: int, seed: int) -> NDArray[np.float32]:
    (film,) = renderer.render([(spp, seed)], is_cancelled=lambda: False)
    return film[..., :3]


def _processor_s() -> float:
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


_WHATS: Final[dict[str, Callable[..., None]]] = {
    one.__name__: one for one in (make, reference, alone, slices)
}

if __name__ == "__main__":
    _WHATS[sys.argv[1]](*sys.argv[2:])
