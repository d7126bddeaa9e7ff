"""Builds OCULIST: `python -m plateau.scenes.oculist.build` writes scene.xml, meshes/ and textures/.

A museum case with an eye in mosaic between inscribed tablets, three oculists' stamps and four
bronze instruments on a woven cloth. In such a case, dense with fine texture and relief, the
predictor of Takouachet et al. (2007) stopped too early. Nothing of theirs is used: letters, words,
patterns and shapes are our own.
"""

from pathlib import Path

import numpy as np

from plateau.scenes.build import document, noise, numbers, scene_files, shape, write_files
from plateau.scenes.mesh import Vector
from plateau.scenes.oculist.case import meshes
from plateau.scenes.oculist.lettering import Field, cut
from plateau.scenes.oculist.mosaic import mosaic
from plateau.scenes.oculist.textures import cloth, grain, grey, inscribed, png, tinted, wood

#: Radiance of the lights, in the units of the image, where 1 is white at EV 0.
BRIGHT = 80.0  # OCULIST 1
DIM = 40.0  # OCULIST 2

#: The camera: its place, its target and its horizontal field of view.
ORIGIN, TARGET, FIELD_OF_VIEW_DEG = (0.0, 2.75, 3.35), (0.0, 0.475, -0.05), 30.8

#: The inscriptions.
FRIEZE = ("NEC·PLVRES·RADII·QVAM·OCVLVS·VIDET",)  # nor more rays than the eye can see
LEFT = (
    "VISVS·LVCIS·EST",
    "LAPIS·OCVLARI",
    "MILLE·RADIOS·NON",
    "VIDET·OCVLVS·SI",
    "TEXTVRA·DENSA",
    "GRANVM·CELAT·ET",
    "VMBRA·MOLLIS",
    "LENIT·ASPERA·SAXA",
    "COLLYRIVM·CLARVM",
    "AD·LIPPITVDINES",
    "POST·IMPETVM",
    "EX·OVO·BIS·TERRE",
)
RIGHT = (
    "QVI·LVCEM·QVAERIT",
    "NVMERET·RADIOS",
    "DVM·NIL·NOVI",
    "APPARET·OCVLIS",
    "TVM·CESSET·ARTIFEX",
    "SATIS·EST·LVCIS",
    "CROCVM·ET·MVRRAM",
    "AES·VSTVM·NARDVM",
    "CADMIAM·LOTAM",
    "MISCE·CVM·AQVA",
    "PLVVIALI·ET·SERVA",
    "IN·VASE·AENEO",
)
_CARDS = (("INSTRVMENTA", "AENEA", "SAEC II"), ("LAPIS OCVLARI", "GALLIA", "SAEC II"))

#: Materials by name: those in relief with its height in units of the scene, and the flat ones.
_RELIEFS = {
    "cloth": 0.008,
    "mosaic": 0.010,
    "frieze": 0.022,
    "left_tablet": 0.014,
    "right_tablet": 0.014,
}
_FLAT = ("serpentine", "jasper", "clay", "oak", "board", "cards")
_PLAIN = ("bronze", "warm", "cool")


def textures() -> dict[str, bytes]:
    """Return the textures by file name."""
    stones, palette, stones_relief = mosaic(seed=11)
    twill, twill_relief = cloth(seed=17)
    cards = np.concatenate([cut((84, 240), lines, 0.8, margin=0.16) for lines in _CARDS])
    return {
        "mosaic.png": png(stones, palette),
        "mosaic_relief.png": grey(stones_relief, 48),
        "cloth.png": png(twill),
        "cloth_relief.png": grey(twill_relief, 32),
        **_inscription("frieze", inscribed((96, 1076), FRIEZE, 25), (70, 20, 14)),
        **_inscription("left_tablet", inscribed((608, 360), LEFT, 20), (40, 24, 18)),
        **_inscription("right_tablet", inscribed((608, 360), RIGHT, 21), (40, 24, 18)),
        "serpentine.png": tinted(grain(192, 3), (70, 96, 74), (154, 176, 138)),
        "jasper.png": tinted(grain(192, 5), (138, 76, 62), (192, 124, 102)),
        "clay.png": tinted(grain(192, 6), (156, 98, 66), (192, 134, 96)),
        "oak.png": tinted(wood((128, 512), 7), (44, 24, 14), (150, 96, 54)),
        "board.png": tinted(noise((128, 128), (64, 64), 9), (30, 12, 14), (84, 34, 34), 8),
        "cards.png": grey(0.76 - 0.68 * np.clip(1.6 * cards, 0, 1), 32),
    }


def _inscription(
    name: str, slab: tuple[Field, Field], paint: tuple[int, int, int]
) -> dict[str, bytes]:
    light, height = slab
    return {
        f"{name}.png": tinted(light, paint, (232, 212, 176), 20),
        f"{name}_relief.png": grey(height, 48),
    }


def scene_xml() -> str:
    """Return the scene's XML."""
    reliefs = [_relief(name, height) for name, height in _RELIEFS.items()]
    looks = "\n".join([*reliefs, *map(_flat, _FLAT)])
    shapes = "\n".join(shape(f"{name}_mesh", name, name) for name in (*_RELIEFS, *_FLAT, *_PLAIN))
    contents = f"""\
{looks}
    <bsdf type="roughconductor" id="bronze">
        <rgb name="eta" value="0.35, 0.75, 1.3"/>
        <rgb name="k" value="3.2, 2.3, 1.7"/>
        <rgb name="specular_reflectance" value="0.66, 0.56, 0.46"/>
        <float name="alpha" value="0.28"/>
    </bsdf>
    <bsdf type="diffuse" id="warm"><rgb name="reflectance" value="0.88, 0.72, 0.50"/></bsdf>
    <bsdf type="diffuse" id="cool"><rgb name="reflectance" value="0.42, 0.56, 0.74"/></bsdf>

{shapes}

    <!-- The key, from the left in front; and two lights that shine on a warm and on a cool screen
         beside the case, so that much of the light arrives by way of these. -->
{_light("key", (-2.3, 2.1, 1.6), (0.1, 0.3, -0.1), (0.32, 0.24))}
{_light("at_warm", (-1.45, 2.0, 0.2), (-1.95, 1.0, 0.0), (0.20, 0.5))}
{_light("at_cool", (1.45, 2.0, 0.2), (1.95, 1.0, 0.0), (0.18, 0.5))}
"""
    return document(
        "oculist",
        contents,
        bright=BRIGHT,
        dim=DIM,
        field_of_view_deg=FIELD_OF_VIEW_DEG,
        origin=numbers(ORIGIN),
        target=numbers(TARGET),
    )


def _relief(name: str, height: float) -> str:
    return f"""\
    <bsdf type="bumpmap" id="{name}">
        <texture type="bitmap">
            <string name="filename" value="textures/{name}_relief.png"/>
            <boolean name="raw" value="true"/>
        </texture>
        <float name="scale" value="{height:g}"/>
        <bsdf type="diffuse">
            <texture type="bitmap" name="reflectance">
                <string name="filename" value="textures/{name}.png"/>
            </texture>
        </bsdf>
    </bsdf>"""


def _flat(name: str) -> str:
    return f"""\
    <bsdf type="diffuse" id="{name}">
        <texture type="bitmap" name="reflectance">
            <string name="filename" value="textures/{name}.png"/>
        </texture>
    </bsdf>"""


def _light(name: str, origin: Vector, target: Vector, half: tuple[float, float]) -> str:
    return f"""\
    <shape type="rectangle" id="{name}">
        <transform name="to_world">
            <scale x="{half[0]:g}" y="{half[1]:g}"/>
            <lookat origin="{numbers(origin)}" target="{numbers(target)}" up="0, 0, 1"/>
        </transform>
        <emitter type="area">
            <rgb name="radiance" value="$intensity"/>
        </emitter>
    </shape>"""


def files() -> dict[str, bytes]:
    """Return every file of the scene by its path in the scene's folder."""
    return scene_files(scene_xml(), meshes(), textures())


if __name__ == "__main__":
    write_files(Path(__file__).parent, files())
