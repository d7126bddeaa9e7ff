"""Builds the box: `python -m plateau.scenes.box.build` writes scene.xml and meshes/.

A room of our own, 2.4 wide, 2 high and 2.2 deep, open towards the camera: an ochre wall, a teal
wall, a tall block, a low plinth with a glossy ball on it, and one rectangle of white light in the
ceiling. Goral et al. (1984, doi:10.1145/800031.808601) made such a room the test of global
illumination; none of the Cornell box's data is used.
"""

from pathlib import Path

from plateau.scenes.build import document, scene_files, shape, write_files
from plateau.scenes.mesh import Mesh, ball, block, quads

#: Radiance of the light, in the units of the image, where 1 is white at EV 0.
BRIGHT = 20.0  # BOX 1
DIM = 10.0  # BOX 2

# The room: x to the right, y up, z towards the camera.
X, Y, Z = 1.2, 2.0, 1.1


def meshes() -> dict[str, Mesh]:
    """Return the meshes by file name."""
    return {
        "room.ply": quads(
            ((-X, 0, Z), (X, 0, Z), (X, 0, -Z), (-X, 0, -Z)),  # floor
            ((-X, Y, -Z), (X, Y, -Z), (X, Y, Z), (-X, Y, Z)),  # ceiling
            ((-X, 0, -Z), (X, 0, -Z), (X, Y, -Z), (-X, Y, -Z)),  # back
        ),
        "left.ply": quads(((-X, 0, Z), (-X, 0, -Z), (-X, Y, -Z), (-X, Y, Z))),
        "right.ply": quads(((X, 0, -Z), (X, 0, Z), (X, Y, Z), (X, Y, -Z))),
        # Turns by whole-number triangles (3-4-5 and 7-24-25) need no sine.
        "block.ply": block((-0.48, -0.36), (0.6, 1.24, 0.6), (4 / 5, 3 / 5)),
        "plinth.ply": block((0.5, 0.22), (0.68, 0.34, 0.68), (24 / 25, -7 / 25)),
        "ball.ply": ball((0.5, 0.34 + 0.27, 0.22), 0.27, subdivisions=2),
    }


def scene_xml() -> str:
    """Return the scene's XML."""
    contents = f"""\
    <bsdf type="twosided" id="white">
        <bsdf type="diffuse"><rgb name="reflectance" value="0.74, 0.72, 0.68"/></bsdf>
    </bsdf>
    <bsdf type="twosided" id="ochre">
        <bsdf type="diffuse"><rgb name="reflectance" value="0.64, 0.29, 0.07"/></bsdf>
    </bsdf>
    <bsdf type="twosided" id="teal">
        <bsdf type="diffuse"><rgb name="reflectance" value="0.07, 0.32, 0.38"/></bsdf>
    </bsdf>
    <bsdf type="roughplastic" id="glaze">
        <rgb name="diffuse_reflectance" value="0.70, 0.12, 0.10"/>
        <float name="alpha" value="0.2"/>
    </bsdf>

{shape("room", "room", "white")}
{shape("left", "left", "ochre")}
{shape("right", "right", "teal")}
{shape("block", "block", "white")}
{shape("plinth", "plinth", "white")}
{shape("ball", "ball", "glaze")}

    <!-- The light: 0.8 by 0.6, a hair below the ceiling, facing down. -->
    <shape type="rectangle" id="light">
        <transform name="to_world">
            <scale x="0.4" y="0.3"/>
            <rotate x="1" angle="90"/>
            <translate y="{Y - 0.002:g}"/>
        </transform>
        <emitter type="area">
            <rgb name="radiance" value="$intensity"/>
        </emitter>
    </shape>
"""
    return document(
        "box",
        contents,
        bright=BRIGHT,
        dim=DIM,
        field_of_view_deg=27.5,
        origin="0, 1.0, 5.1",
        target="0, 1.0, 0",
    )


def files() -> dict[str, bytes]:
    """Return every file of the scene by its path in the scene's folder."""
    return scene_files(scene_xml(), meshes(), textures={})


if __name__ == "__main__":
    write_files(Path(__file__).parent, files())
