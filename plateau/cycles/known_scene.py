"""The scene of the known image: a diffuse sphere in white light, in an orthographic view."""

from __future__ import annotations

from typing import Any, Final

from plateau.cycles.blender import bpy
from plateau.worker.renderers.canary import SPHERE_RADIUS, SPHERE_REFLECTANCE

#: Pixels of each side.
SIZE: Final = 32
_SEGMENTS: Final = 128


def build() -> Any:
    """Return the scene, in an otherwise empty file."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.resolution_x = scene.render.resolution_y = SIZE
    scene.cycles.pixel_filter_type = "BOX"
    scene.world = bpy.data.worlds.new("white")
    _nodes(scene.world)["Background"].inputs["Color"].default_value = (1, 1, 1, 1)
    bpy.ops.mesh.primitive_uv_sphere_add(
        segments=_SEGMENTS, ring_count=_SEGMENTS // 2, radius=SPHERE_RADIUS
    )
    matt = bpy.data.materials.new("matt")
    nodes = _nodes(matt)
    diffuse = nodes.new("ShaderNodeBsdfDiffuse")
    diffuse.inputs["Color"].default_value = (*SPHERE_REFLECTANCE, 1)
    matt.node_tree.links.new(diffuse.outputs["BSDF"], nodes["Material Output"].inputs["Surface"])
    bpy.context.object.data.materials.append(matt)
    bpy.ops.object.camera_add(location=(0, 0, 4))
    scene.camera = bpy.context.object
    scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 2.0
    return scene


def _nodes(of: Any) -> Any:
    if of.node_tree is None:  # before Blender 5
        of.use_nodes = True
    return of.node_tree.nodes
