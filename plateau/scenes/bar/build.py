"""Builds the bar: `python -m plateau.scenes.bar.build` writes scene.xml, meshes/ and textures/.

A small bar of our own towards evening, in metres. The bowls over the counter and the coves light
the ceiling only. A wide window in the right wall, outside the picture, gives soft daylight from the
side, and panels of lit onyx glow behind the bottles. Takouachet et al. (2007) judged such a room;
nothing of theirs is used.
"""

from collections.abc import Iterable
from pathlib import Path

from plateau.scenes.bar import fittings, room, stock, vessels
from plateau.scenes.bar.pictures import textures
from plateau.scenes.bar.stock import Copy
from plateau.scenes.build import document, numbers, scene_files, shape, write_files
from plateau.scenes.mesh import Mesh, Vector

#: `intensity`, the factor of all radiances, in the units of the image, where 1 is white at EV 0.
BRIGHT = 80.0  # BAR 1
DIM = 40.0  # BAR 2

#: The camera: its place, its target and its horizontal field of view.
EYE: Vector = (0.62, 1.52, 2.55)
TARGET: Vector = (-0.62, 1.17, -0.6)
FIELD_OF_VIEW_DEG = 52.0


def meshes() -> dict[str, Mesh]:
    """Return the meshes by file name."""
    shaker, shaker_band = vessels.shaker()
    made = {
        **room.shell(),
        "wood": room.woodwork(),
        "slab": room.slab(),
        "trim": room.trim(),
        "tiles": room.tiles(seed=3),
        "coves": room.coves(),
        "daylight": room.daylight(),
        "filaments": fittings.filaments(stock.LAMPS),
        "bowl": fittings.bowl(),
        "lamp_rod": fittings.rod(0.006, 0.92),
        "cushion": fittings.cushion(),
        "pedestal": fittings.pedestal(),
        "band": fittings.band(),
        "ring": fittings.ring(0.16, 0.009),
        "rail": fittings.rod(0.02, 5.0, 24),
        "tap": fittings.tap(),
        "shaker": shaker,
        "shaker_band": shaker_band,
    }
    for kind, bottle in vessels.BOTTLES.items():
        made |= {f"{kind}_{part}": mesh for part, mesh in bottle.meshes().items()}
    for kind, glass in vessels.GLASSES.items():
        if kind == "goblet":
            made["goblet_empty"] = vessels.empty(glass)
        else:
            made |= {f"{kind}_{part}": mesh for part, mesh in glass.meshes().items()}
    return {f"{name}.ply": mesh for name, mesh in made.items()}


def _copies() -> dict[str, list[Copy]]:
    """Return every copy by its material."""
    parts: dict[str, list[Copy]] = {}
    for several in (stock.stock(seed=4), stock.laid(), _fitted()):
        for material, copies in several.items():
            parts.setdefault(material, []).extend(copies)
    return parts


def _fitted() -> dict[str, list[Copy]]:
    brass = [Copy("bowl", at) for at in stock.LAMPS]
    brass += [Copy("lamp_rod", at) for at in stock.LAMPS]
    leather, steel = [], []
    for x, z in stock.STOOLS:
        leather.append(Copy("cushion", (x, 0, z)))
        brass.append(Copy("band", (x, 0, z)))
        brass.append(Copy("ring", (x, 0.26, z)))
        steel.append(Copy("pedestal", (x, 0, z)))
    brass.append(Copy("tap", (-0.40, room.COUNTER_TOP, -0.75)))
    brass.append(Copy("shaker_band", (-0.50, room.COUNTER_TOP + 0.0005, 0.98)))
    return {"brass": brass, "leather": leather, "steel": steel}


def scene_xml() -> str:
    """Return the scene's XML."""
    merged = "\n".join(_merged(material, copies) for material, copies in _copies().items())
    contents = f"""\
{_glossy("walnut", 0.2, _picture("walnut"))}
{_glossy("glaze", 0.10, _picture("glazes"))}
{_glossy("leather", 0.25, _rgb("diffuse_reflectance", (0.30, 0.025, 0.022)))}
{_glossy("stone", 0.10, _rgb("diffuse_reflectance", (0.55, 0.52, 0.47)))}
{_glossy("cap", 0.15, _rgb("diffuse_reflectance", (0.03, 0.025, 0.025)))}
    <bsdf type="roughplastic" id="chequers">
        <texture type="checkerboard" name="diffuse_reflectance">
            <rgb name="color0" value="0.16, 0.15, 0.14"/>
            <rgb name="color1" value="0.58, 0.53, 0.45"/>
        </texture>
        <float name="alpha" value="0.3"/>
    </bsdf>
{_metal("brass", 0.2, (0.86, 0.63, 0.30))}
{_metal("steel", 0.18, (0.72, 0.71, 0.69))}
{_metal("silvering", 0.04, (0.78, 0.76, 0.72))}
{_matt("ceiling", (0.80, 0.72, 0.60))}
{_matt("paint", (0.20, 0.37, 0.36))}
{_matt("cream", (0.72, 0.64, 0.48))}
{_matt("black", (0.03, 0.03, 0.035))}
{"".join(_glass(name, 1.5, 1.0, colour) for name, colour in stock.COLOURS.items())}\
{_glass("cocktail", 1.5, 1.34, (0.92, 0.36, 0.22))}\
{_glass("cocktail_level", 1.34, 1.0, (1.0, 1.0, 1.0))}\
{_glass("whisky", 1.5, 1.36, (0.93, 0.60, 0.22))}\
{_glass("whisky_level", 1.36, 1.0, (1.0, 1.0, 1.0))}
{shape("floor_mesh", "floor", "chequers")}
{shape("ceiling_mesh", "ceiling", "ceiling")}
{shape("walls_mesh", "walls", "paint")}
{shape("mirror_mesh", "mirror", "silvering")}
{shape("wood_mesh", "wood", "walnut")}
{shape("slab_mesh", "slab", "stone")}
{shape("trim_mesh", "trim", "brass")}
{shape("tiles_mesh", "tiles", "glaze")}
    <shape type="ply" id="rail_mesh">
        <string name="filename" value="meshes/rail.ply"/>
        <transform name="to_world">
            <rotate x="1" angle="90"/>
            <translate x="0.06" y="0.18" z="-2.4"/>
        </transform>
        <ref id="brass"/>
    </shape>

{merged}
    <!-- What shines: the lamps and the coves at the ceiling, the onyx, the windows. -->
{_light("filaments_mesh", "ply", _file("filaments"), (0.45, 0.35, 0.235), 2)}\
{_light("coves_mesh", "ply", _file("coves"), (0.17, 0.13, 0.085), 2)}\
{_light("onyx_mesh", "ply", _file("onyx"), (0.0118, 0.0064, 0.0024), 1)}\
{_light("daylight_mesh", "ply", _file("daylight"), (0.062, 0.067, 0.073), 4)}\
{_light("window", "rectangle", _window(), (0.0044, 0.0068, 0.0108), 0.3)}"""
    return document(
        "bar",
        contents,
        bright=BRIGHT,
        dim=DIM,
        field_of_view_deg=FIELD_OF_VIEW_DEG,
        origin=numbers(EYE),
        target=numbers(TARGET),
    )


def _rgb(name: str, colour: Vector) -> str:
    return f'<rgb name="{name}" value="{numbers(colour)}"/>'


def _picture(name: str) -> str:
    return f"""\
<texture type="bitmap" name="diffuse_reflectance">
            <string name="filename" value="textures/{name}.png"/>
        </texture>"""


def _glossy(name: str, alpha: float, reflectance: str) -> str:
    return f"""\
    <bsdf type="roughplastic" id="{name}">
        {reflectance}
        <float name="alpha" value="{alpha:g}"/>
    </bsdf>"""


def _metal(name: str, alpha: float, colour: Vector) -> str:
    return f"""\
    <bsdf type="roughconductor" id="{name}">
        <string name="material" value="none"/>
        {_rgb("specular_reflectance", colour)}
        <float name="alpha" value="{alpha:g}"/>
    </bsdf>"""


def _matt(name: str, colour: Vector) -> str:
    return f'    <bsdf type="diffuse" id="{name}">{_rgb("reflectance", colour)}</bsdf>'


def _glass(name: str, inside: float, outside: float, colour: Vector) -> str:
    return f"""\
    <bsdf type="dielectric" id="{name}">
        <float name="int_ior" value="{inside:g}"/>
        <float name="ext_ior" value="{outside:g}"/>
        {_rgb("specular_transmittance", colour)}
    </bsdf>
"""


def _file(name: str) -> str:
    return f'<string name="filename" value="meshes/{name}.ply"/>'


def _merged(material: str, copies: Iterable[Copy]) -> str:
    """Return all copies of one material as one shape."""
    text = "".join(_copy(copy, material) for copy in copies)
    return f'    <shape type="merge" id="{material}_all">\n{text}    </shape>'


def _copy(copy: Copy, material: str) -> str:
    x, y, z = copy.at
    return f"""\
        <shape type="ply">
            {_file(copy.mesh)}
            <transform name="to_world">
                <scale value="{copy.scale:.3f}"/>
                <rotate y="1" angle="{copy.turn_deg:.0f}"/>
                <translate x="{x:.4f}" y="{y:.4f}" z="{z:.4f}"/>
            </transform>
            <ref id="{material}"/>
        </shape>
"""


def _window() -> str:
    x, y = (
        (room.WINDOW_LEFT + room.WINDOW_RIGHT) / 2,
        (room.WINDOW_LOW + room.WINDOW_HIGH) / 2,
    )
    return f"""\
<transform name="to_world">
            <scale x="{room.WINDOW_RIGHT - x:g}" y="{room.WINDOW_HIGH - y:g}"/>
            <translate x="{x:g}" y="{y:g}" z="{room.FAR + 0.01:g}"/>
        </transform>"""


def _light(name: str, shape: str, where: str, colour: Vector, weight: float) -> str:
    """Return a light whose colour is relative to `intensity`; only `d65` can scale a colour.

    The weight is relative: how often shadow rays sample this light.
    """
    return f"""\
    <shape type="{shape}" id="{name}">
        {where}
        <emitter type="area">
            <float name="sampling_weight" value="{weight:g}"/>
            <spectrum type="d65" name="radiance">
                {_rgb("color", colour)}
                <float name="scale" value="$intensity"/>
            </spectrum>
        </emitter>
    </shape>
"""


def files() -> dict[str, bytes]:
    """Return every file of the scene by its path in the scene's folder."""
    return scene_files(scene_xml(), meshes(), textures())


if __name__ == "__main__":
    write_files(Path(__file__).parent, files())
