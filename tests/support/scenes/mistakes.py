"""Mistakes in the file of a first scene of one's own, and what is said of each."""

from typing import Final

XML: Final = """<scene version="3.0.0">
<integrator type="path"/>
<sensor type="perspective">
<transform name="to_world"><lookat origin="0,0,5" target="0,0,0" up="0,1,0"/></transform>
<film type="hdrfilm"><integer name="width" value="16"/><integer name="height" value="16"/></film>
</sensor>
<emitter type="constant"/>
<shape type="sphere" name="ball"><bsdf type="diffuse"></bsdf></shape>
</scene>"""
IMAGE: Final = '<texture type="bitmap" name="reflectance"><string name="filename" value="{}"/>'
PAINTED: Final = f'<bsdf type="diffuse">{IMAGE}</texture>'
WOOD: Final = PAINTED.format("wood.png")
CAMERA: Final = XML[XML.index("<sensor") : XML.index("<emitter")]

#: As the commands say it of a folder, and the API of an upload.
ABSENT: Final = "(?:does not exist; put it there|is not in the bundle; add it), or correct"

#: What is another in the file, and what is said of it before anything is rendered.
IN_A_FILE: Final[dict[str, tuple[tuple[tuple[str, str], ...], str]]] = {
    "a missing texture": (
        (('<bsdf type="diffuse">', WOOD),),
        rf"scene\.xml, line 8: 'wood\.png' {ABSENT}",
    ),
    "a wrong name of a plugin": (
        (('"diffuse"', '"difuse"'),),
        r"scene\.xml, line 8: .* no plugin of the type 'difuse'; did you mean 'diffuse'\?",
    ),
    "a file for Mitsuba 0.6": (
        (("3.0.0", "0.6.0"), ("lookat", "lookAt"), ('"path"', '"photonmapper"')),
        r"line 2: .* for Mitsuba '0\.6\.0'.* line 2, 'photonmapper': use path; .* write <lookat>",
    ),
    "no camera": (((CAMERA, ""),), r"the scene has no camera; add a <sensor>"),
    "a huge film": (
        (('"16"', '"64000"'),),
        r"scene\.xml, line 5: a film of 64000×64000 pixels .*; lower its width and height",
    ),
    "a path of Windows": (
        (('<bsdf type="diffuse">', PAINTED.format(r"C:\art\wood.png")),),
        r"line 8: 'C:.*wood\.png' is a path of Windows; .* name it by a relative path, with /",
    ),
    "backslashes": (
        (('<bsdf type="diffuse">', PAINTED.format(r"art\oak.png")),),
        rf"line 8: 'art.*oak\.png' {ABSENT}.*; did you mean 'art/oak\.png' \(with / between",
    ),
    "an include of a file elsewhere": (
        (("<emitter", '<include filename="sky.xml"/>\n<emitter'),),
        rf"line 7: 'sky\.xml' {ABSENT}",
    ),
}


def mistaken(mistake: str) -> str:
    """The scene's file with one of `IN_A_FILE`."""
    text = XML
    for old, new in IN_A_FILE[mistake][0]:
        assert old in text
        text = text.replace(old, new)
    return text
