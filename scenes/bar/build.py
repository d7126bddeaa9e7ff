"""Builds the bar: `python -m scenes.bar.build` writes scene.xml, meshes/ and textures/.

A small bar of our own in the evening, in metres. The lamps over the counter and the cove on the
back bar shine at the ceiling, the strips behind the shelves at the panels behind the bottles, so
that nearly all light has been reflected before it reaches what one sees; a window gives some blue.
Takouachet et al. (2007) judged such a room; nothing of theirs is used.
"""

from collections.abc import Iterable
from pathlib import Path

from scenes.bar import fittings, room, stock, vessels
from scenes.bar.pictures import textures
from scenes.bar.stock import Copy
from scenes.build import document, scene_files, write_files
from scenes.mesh import Mesh, Vector

HERE = Path(__file__).parent

#: Radiance of the lamps' filaments, in the units of the image: what is 1 there is white at EV 0.
BRIGHT = 120.0  # BAR 1
DIM = 60.0  # BAR 2

#: The camera: where it is, where it looks, and how wide, in degrees.
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
        "strips": room.strips(),
        "cove": room.cove(),
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
    brass.append(Copy("shaker_band", (-0.46, room.COUNTER_TOP + 0.0005, 0.78)))
    return {"brass": brass, "leather": leather, "steel": steel}


def scene_xml() -> str:
    """Return the scene's XML."""
    merged = "\n".join(_merged(material, copies) for material, copies in _copies().items())
    lit = "".join(
        _light(f"lamp_{number}", "disk", _at((x, y + 0.085, z), 0.14), (0.42, 0.31, 0.20))
        for number, (x, y, z) in enumerate(stock.LAMPS)
    )
    contents = f"""\
{_glossy("walnut", 0.25, _picture("walnut"))}
{_glossy("glaze", 0.10, _picture("glazes"))}
{_glossy("leather", 0.25, _rgb("diffuse_reflectance", (0.42, 0.06, 0.05)))}
{_glossy("stone", 0.10, _rgb("diffuse_reflectance", (0.55, 0.52, 0.47)))}
{_glossy("cap", 0.15, _rgb("diffuse_reflectance", (0.03, 0.025, 0.025)))}
    <bsdf type="roughplastic" id="chequers">
        <texture type="checkerboard" name="diffuse_reflectance">
            <rgb name="color0" value="0.16, 0.15, 0.14"/>
            <rgb name="color1" value="0.58, 0.53, 0.45"/>
        </texture>
        <float name="alpha" value="0.3"/>
    </bsdf>
{_metal("brass", 0.3, (0.86, 0.63, 0.30))}
{_metal("steel", 0.25, (0.72, 0.71, 0.69))}
{_metal("silvering", 0.1, (0.78, 0.76, 0.72))}
{_matt("ceiling", (0.80, 0.72, 0.60))}
{_matt("paint", (0.30, 0.50, 0.50))}
{_matt("panel", (0.78, 0.55, 0.30))}
{_matt("cream", (0.72, 0.64, 0.48))}
{_matt("black", (0.03, 0.03, 0.035))}
{"".join(_pane(name, colour) for name, colour in stock.COLOURS.items())}\
{_glass("cocktail", 1.5, 1.34, (0.92, 0.36, 0.22))}\
{_glass("cocktail_level", 1.34, 1.0, (1.0, 1.0, 1.0))}\
{_glass("whisky", 1.5, 1.36, (0.93, 0.60, 0.22))}\
{_glass("whisky_level", 1.36, 1.0, (1.0, 1.0, 1.0))}
{_shape("floor", "chequers")}
{_shape("ceiling", "ceiling")}
{_shape("walls", "paint")}
{_shape("panels", "panel")}
{_shape("mirror", "silvering")}
{_shape("wood", "walnut")}
{_shape("slab", "stone")}
{_shape("trim", "brass")}
{_shape("tiles", "glaze")}
    <shape type="ply" id="rail_mesh">
        <string name="filename" value="meshes/rail.ply"/>
        <transform name="to_world">
            <rotate x="1" angle="90"/>
            <translate x="0.06" y="0.18" z="-2.4"/>
        </transform>
        <ref id="brass"/>
    </shape>

{merged}
    <!-- What shines: into the lamps' bowls, at the panels, at the ceiling; and the evening. -->
{lit}{_light("strips_mesh", "ply", _file("strips"), (0.28, 0.18, 0.09))}\
{_light("cove_mesh", "ply", _file("cove"), (0.36, 0.24, 0.13))}\
{_light("window", "rectangle", _window(), (0.026, 0.033, 0.042))}"""
    return document(
        "bar",
        contents,
        bright=BRIGHT,
        dim=DIM,
        max_depth=8,
        field_of_view_deg=FIELD_OF_VIEW_DEG,
        origin=_numbers(EYE),
        target=_numbers(TARGET),
    )


def _numbers(vector: Iterable[float]) -> str:
    return ", ".join(f"{number:g}" for number in vector)


def _rgb(name: str, colour: Vector) -> str:
    return f'<rgb name="{name}" value="{_numbers(colour)}"/>'


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


def _pane(name: str, colour: Vector) -> str:
    """Return thin glass, which tints what is behind it and focuses no light."""
    return f"""\
    <bsdf type="thindielectric" id="{name}">
        {_rgb("specular_transmittance", colour)}
    </bsdf>
"""


def _file(name: str) -> str:
    return f'<string name="filename" value="meshes/{name}.ply"/>'


def _shape(name: str, bsdf: str) -> str:
    return f"""\
    <shape type="ply" id="{name}_mesh">
        {_file(name)}
        <ref id="{bsdf}"/>
    </shape>"""


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


def _at(at: Vector, scale: float) -> str:
    x, y, z = at
    return f"""\
<transform name="to_world">
            <scale value="{scale:g}"/>
            <rotate x="1" angle="-90"/>
            <translate x="{x:g}" y="{y:g}" z="{z:g}"/>
        </transform>"""


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


def _light(name: str, shape: str, where: str, colour: Vector) -> str:
    """Return a light whose colour is in parts of `intensity`: `d65` is what can scale a colour."""
    return f"""\
    <shape type="{shape}" id="{name}">
        {where}
        <emitter type="area">
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


def write(folder: Path) -> None:
    """Write the scene into a folder."""
    write_files(folder, files())


if __name__ == "__main__":
    write(HERE)
