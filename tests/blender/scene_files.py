"""Makes the Blender files of these tests, in a process of its own: python -m … WHAT PATH."""

import sys
from pathlib import Path

import bpy

SCRIPT = "import bpy\nbpy.context.scene.render.resolution_x = 7\n"


def plain() -> None:
    """A red ball on a grey floor, under a lamp; the ball moves from frame to frame."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = 64, 48
    bpy.ops.mesh.primitive_plane_add(size=8)
    _paint((0.6, 0.6, 0.6, 1))
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.8, location=(0, 0, 0.8))
    _paint((0.8, 0.2, 0.1, 1))
    ball = bpy.context.object
    ball.keyframe_insert("location", frame=1)
    ball.location.x = 3
    ball.keyframe_insert("location", frame=11)
    bpy.ops.object.light_add(type="AREA", location=(2, -2, 4))
    bpy.context.object.data.energy = 300
    bpy.ops.object.camera_add(location=(0, 0, 6))
    bpy.context.object.name = "above"
    bpy.ops.object.camera_add(location=(4, -4, 3), rotation=(1.1, 0, 0.785))
    bpy.context.object.name = "aside"
    scene.camera = bpy.context.object


def filmic() -> None:
    """Seen through Filmic with high contrast, a stop brighter."""
    plain()
    view = bpy.context.scene.view_settings
    view.view_transform, view.look, view.exposure = "Filmic", "High Contrast", 1.0


def transparent() -> None:
    plain()
    bpy.context.scene.render.film_transparent = True


def eevee() -> None:
    plain()
    bpy.context.scene.render.engine = "BLENDER_EEVEE"


def flat() -> None:
    """The ball is as a driver that never ran leaves it."""
    plain()
    bpy.data.objects["Sphere"].scale.z = 0


def scripted() -> None:
    """A script that Blender runs on opening, and a driver in Python, where both are trusted."""
    flat()
    text = bpy.data.texts.new("hostile.py")
    text.from_string(SCRIPT)
    text.use_module = True
    driver = bpy.data.objects["Sphere"].driver_add("scale", 2).driver
    driver.type = "SCRIPTED"
    driver.expression = "float(__import__('os').getpid() > 0)"


def textured() -> None:
    """The floor's texture is a file beside the scene."""
    plain()
    target = Path(sys.argv[2])
    image = bpy.data.images.new("tiles", 4, 4)
    image.pixels = [0.1, 0.9, 0.1, 1.0] * 16
    (target.parent / "textures").mkdir(exist_ok=True)
    image.filepath_raw = str(target.parent / "textures" / "tiles.png")
    image.file_format = "PNG"
    image.save()
    image.filepath = "//textures/tiles.png"
    material = bpy.data.objects["Plane"].data.materials[0]
    node = material.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    shader = material.node_tree.nodes["Principled BSDF"]
    material.node_tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])


def smoke() -> None:
    """A cube of smoke that is denser here than there, on the floor."""
    plain()
    bpy.data.objects.remove(bpy.data.objects["Sphere"])
    bpy.ops.mesh.primitive_cube_add(size=2, location=(0, 0, 1))
    material = bpy.data.materials.new("smoke")
    if material.node_tree is None:
        material.use_nodes = True
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


def shadow_catcher() -> None:
    plain()
    bpy.context.scene.render.film_transparent = True
    bpy.data.objects["Plane"].is_shadow_catcher = True


def passes() -> None:
    """Balls that shine, refract and glow, in fog, with every pass that a view layer has."""
    smoke()
    scene = bpy.context.scene
    layer = scene.view_layers[0]
    layer.name = "Küche"
    cube = bpy.context.object
    cube.location, cube.scale = (-1.5, 1.5, 0.5), (0.4, 0.4, 0.4)
    balls = {
        "shining": {"Base Color": (0.8, 0.2, 0.1, 1), "Roughness": 0.3},
        "glass": {"Transmission Weight": 1.0, "Roughness": 0.2},
        "glowing": {"Emission Color": (1, 0.5, 0.2, 1), "Emission Strength": 2},
    }
    for place, (name, inputs) in enumerate(balls.items()):
        bpy.ops.mesh.primitive_uv_sphere_add(radius=0.6, location=(place - 1, place - 1, 0.6))
        bpy.context.object.name = name
        bpy.context.object.pass_index = place + 3
        _paint((0.8, 0.8, 0.8, 1))
        material = bpy.context.object.data.materials[0]
        material.pass_index = 7
        for socket, value in inputs.items():
            material.node_tree.nodes["Principled BSDF"].inputs[socket].default_value = value
    mine = material.node_tree.nodes.new("ShaderNodeOutputAOV")
    mine.aov_name, mine.inputs["Color"].default_value = "mine", (0.1, 0.2, 0.3, 1)
    scene.world = bpy.data.worlds.new("sky")
    if scene.world.node_tree is None:
        scene.world.use_nodes = True
    layer.aovs.add().name = "mine"
    layer.lightgroups.add(name="key")
    bpy.data.objects["Area"].lightgroup = "key"
    for of in (layer, layer.cycles):
        for setting in dir(of):
            if setting.startswith(("use_pass", "pass_", "denoising_store")):
                setattr(of, setting, True)
    layer.pass_cryptomatte_depth = 6


def light_alone() -> None:
    """Its view layer asks for direct light, and for no colour of a surface."""
    plain()
    bpy.context.scene.view_layers[0].use_pass_diffuse_direct = True


def _paint(colour: tuple[float, ...]) -> None:
    material = bpy.data.materials.new("paint")
    if material.node_tree is None:
        material.use_nodes = True
    material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = colour
    bpy.context.object.data.materials.append(material)


def show(blend: str, exr: str, png: str) -> None:
    """Save a linear image as Blender shows it through the view transform of a scene."""
    bpy.ops.wm.open_mainfile(filepath=blend, load_ui=False)
    settings = bpy.context.scene.render.image_settings
    settings.file_format, settings.color_mode, settings.color_depth = "PNG", "RGB", "8"
    bpy.context.scene.render.dither_intensity = 0
    bpy.data.images.load(exr).save_render(png, scene=bpy.context.scene)


if __name__ == "__main__" and sys.argv[1] == "show":
    show(*sys.argv[2:])
elif __name__ == "__main__":
    globals()[sys.argv[1]]()
    bpy.ops.wm.save_as_mainfile(
        filepath=sys.argv[2], compress=sys.argv[1] == "transparent", relative_remap=False
    )
