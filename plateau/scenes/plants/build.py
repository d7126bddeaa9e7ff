"""Builds the plants: `python -m plateau.scenes.plants.build` writes all its files.

A garden corner of our own, in metres: an old wall with ivy, paving with a terracotta pot of
daisies and a glazed jar, and a bed of ferns, hostas and foxgloves, in dappled sun.

Each plant is one mesh (or two) that is placed many times. Mitsuba's `instance` would say so best,
but in the JIT variants of 3.9.1 what it traces grows with the square of their number (mitsuba3
issue 1017, mended after 3.9.1 by pull request 1945): this scene took up to a minute to compile and
rendered at about a fifth of its speed. `merge` makes one mesh of the copies instead.
"""

import math
from collections.abc import Callable
from pathlib import Path

from plateau.scenes.build import document, scene_files, write_files
from plateau.scenes.mesh import Mesh, Vector
from plateau.scenes.plants import flora, masonry
from plateau.scenes.plants.pictures import textures, to_png
from plateau.scenes.plants.planting import SUN, Placement, placements

#: What scales sun and sky alike: at 1 the sun's irradiance is `SUN_COLOUR`, facing it.
BRIGHT = 24.0  # PLANTS 1
DIM = 12.0  # PLANTS 2

#: The camera.
EYE: Vector = (0.1, 1.0, 3.1)
TARGET: Vector = (0.02, 0.58, -0.3)
FIELD_OF_VIEW_DEG = 35.0

SUN_COLOUR = (0.50, 0.44, 0.35)
#: The sun is seven needles of light, one amid six, as far apart as its limb is from its middle.
#: Shadow rays of the `path` integrator take a masked card for closed. A disk would still be hit
#: through the holes, once in some 50,000 scattered rays, and then counted in full: fireflies.
#: Needles are never hit, so a card's shadow from the sun (not from the sky) is the whole card's;
#: that is why the cards keep close to their leaves.
SUN_RADIUS_DEG = 0.3

MESHES: dict[str, Callable[[], Mesh]] = {
    "fern": flora.fern,
    "hosta": flora.hosta,
    "grass": flora.grass,
    "creeper": flora.creeper,
    "ivy": flora.ivy,
    "bough": flora.bough,
    "foxglove": flora.foxglove_bells,
    "foxglove_stem": flora.foxglove_stem,
    "daisy": flora.daisy_flowers,
    "daisy_stem": flora.daisy_leaves,
    "wall": masonry.wall,
    "soil": masonry.soil,
    "flagstones": masonry.flagstones,
    "pot": masonry.pot,
    "jar": masonry.jar,
}


def meshes() -> dict[str, Mesh]:
    """Return the meshes by file name."""
    return {f"{name}.ply": grow() for name, grow in MESHES.items()}


def scene_xml() -> str:
    """Return the scene's XML."""
    contents = f"""\
    <!-- Leaves let light through; the masks cut fronds, lobes and petals out of cards. -->
{_mask("frond", _leaf("frond"))}
{_mask("ivy_leaf", _leaf("ivy_leaf", transmits=0.5))}
{_mask("petals", _leaf("petals", transmits=0.6))}
{_named("hosta_leaf", _leaf("hosta_leaf"))}
{_named("bell", _leaf("bell"))}
{_named("blade", _leaf((0.20, 0.38, 0.07)))}
{_named("leaf", _leaf((0.13, 0.28, 0.06)))}
{_plain("plaster")}
{_plain("earth")}
{_plain("stone")}
{_plain("clay")}
    <bsdf type="roughplastic" id="glaze">
        <rgb name="diffuse_reflectance" value="0.03, 0.16, 0.20"/>
        <float name="alpha" value="0.15"/>
    </bsdf>

{_shape("wall", "plaster")}
{_shape("soil", "earth")}
{_shape("flagstones", "stone")}
{_shape("pot", "clay", masonry.POT_AT)}
{_shape("jar", "glaze", masonry.JAR_AT)}

{_plants()}
    <!-- The sky, and the sun as a few needles of light. -->
    <emitter type="sunsky">
        <vector name="sun_direction" value="{_numbers(SUN, 2)}"/>
        <float name="sun_scale" value="0"/>
        <float name="sky_scale" value="$intensity"/>
        <float name="turbidity" value="3"/>
        <transform name="to_world">
            <rotate x="1" angle="-90"/>
        </transform>
    </emitter>
{_suns()}"""
    return document(
        "plants",
        contents,
        bright=BRIGHT,
        dim=DIM,
        field_of_view_deg=FIELD_OF_VIEW_DEG,
        origin=_numbers(EYE, 2),
        target=_numbers(TARGET, 2),
    )


def _numbers(values: tuple[float, ...], decimals: int) -> str:
    return ", ".join(f"{value:.{decimals}f}" for value in values)


def _named(name: str, bsdf: str) -> str:
    return bsdf.replace('">', f'" id="{name}">', 1)


def _bitmap(name: str, file: str, raw: str = "") -> str:
    return f"""\
        <texture type="bitmap" name="{name}">
            <string name="filename" value="textures/{file}.png"/>{raw}
        </texture>"""


def _leaf(colour: str | Vector, *, transmits: float = 0.8) -> str:
    """Return a thin leaf's material, of a texture or a colour; 1 transmits as it reflects."""
    base = (
        _bitmap("base_color", colour)
        if isinstance(colour, str)
        else f'        <rgb name="base_color" value="{_numbers(colour, 2)}"/>'
    )
    return f"""\
    <bsdf type="principledthin">
{base}
        <float name="diff_trans" value="{transmits:g}"/>
        <float name="roughness" value="0.45"/>
        <float name="eta" value="1.4"/>
    </bsdf>"""


def _mask(name: str, leaf: str) -> str:
    raw = '\n            <boolean name="raw" value="true"/>'
    inner = "\n".join(f"    {line}" for line in leaf.splitlines())
    return f"""\
    <bsdf type="mask" id="{name}">
{_bitmap("opacity", f"{name}_mask", raw)}
{inner}
    </bsdf>"""


def _plain(name: str) -> str:
    return f"""\
    <bsdf type="twosided" id="{name}">
        <bsdf type="diffuse">
{_bitmap("reflectance", name)}
        </bsdf>
    </bsdf>"""


def _shape(name: str, bsdf: str, at: Vector = (0.0, 0.0, 0.0)) -> str:
    return f"""\
    <shape type="ply" id="{name}">
        <string name="filename" value="meshes/{name}.ply"/>
        <transform name="to_world">
            <translate value="{_numbers(at, 2)}"/>
        </transform>
        <ref id="{bsdf}"/>
    </shape>"""


#: The parts of each plant: a mesh and its material.
PARTS: dict[str, tuple[tuple[str, str], ...]] = {
    "fern": (("fern", "frond"),),
    "hosta": (("hosta", "hosta_leaf"),),
    "grass": (("grass", "blade"),),
    "creeper": (("creeper", "leaf"),),
    "ivy": (("ivy", "ivy_leaf"),),
    "bough": (("bough", "leaf"),),
    "foxglove": (("foxglove", "bell"), ("foxglove_stem", "leaf")),
    "daisies": (("daisy", "petals"), ("daisy_stem", "leaf")),
}


def _plants() -> str:
    """Return every plant's copies, merged for each part."""
    everything = placements()
    text = ""
    for plant, parts in PARTS.items():
        copies = [placement for placement in everything if placement.plant == plant]
        for mesh, bsdf in parts:
            text += f'    <shape type="merge" id="{mesh}">\n'
            text += "".join(_copy(mesh, bsdf, placement) for placement in copies)
            text += "    </shape>\n\n"
    return text


def _copy(mesh: str, bsdf: str, placement: Placement) -> str:
    x, y, z = placement.at
    return f"""\
        <shape type="ply">
            <string name="filename" value="meshes/{mesh}.ply"/>
            <transform name="to_world">
                <scale value="{placement.scale:.2f}"/>
                <rotate z="1" angle="{placement.lean_deg:.0f}"/>
                <rotate y="1" angle="{placement.turn_deg:.0f}"/>
                <translate x="{x:.3f}" y="{y:.3f}" z="{z:.3f}"/>
            </transform>
            <ref id="{bsdf}"/>
        </shape>
"""


def _suns() -> str:
    return "".join(
        f"""\
    <emitter type="directional">
        <vector name="direction" value="{_numbers(direction, 5)}"/>
        <float name="sampling_weight" value="0.3"/>
        <spectrum type="d65" name="irradiance">
            <rgb name="color" value="{_numbers(tuple(c / 7 for c in SUN_COLOUR), 4)}"/>
            <float name="scale" value="$intensity"/>
        </spectrum>
    </emitter>
"""
        for direction in sun_directions()
    )


def sun_directions() -> list[Vector]:
    """Return the directions in which the sun's seven needles shine."""
    x, y, z = SUN
    flat = math.hypot(x, z)
    across, upwards = (z / flat, 0.0, -x / flat), (-x * y / flat, flat, -z * y / flat)
    radius = math.radians(SUN_RADIUS_DEG)
    offsets = [(0.0, 0.0)] + [
        (radius * math.cos(k * math.pi / 3), radius * math.sin(k * math.pi / 3)) for k in range(6)
    ]
    return [
        (
            -(x + a * across[0] + b * upwards[0]),
            -(y + a * across[1] + b * upwards[1]),
            -(z + a * across[2] + b * upwards[2]),
        )
        for a, b in offsets
    ]


def files() -> dict[str, bytes]:
    """Return every file of the scene by its path in the scene's folder."""
    pictures = {name: to_png(picture) for name, picture in textures().items()}
    return scene_files(scene_xml(), meshes(), pictures)


if __name__ == "__main__":
    write_files(Path(__file__).parent, files())
