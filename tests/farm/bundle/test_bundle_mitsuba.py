"""The check follows files and reads films as Mitsuba does: each scene is given to both."""

import json
import re
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest

from plateau.farm.bundle import BundleError, inspect_bundle, known_plugins
from tests.support.scenes.bundles import PLY, include, mesh, scene, zipped

SPECTRUM = b"400 0.5\n700 0.5\n"
FILM = '<sensor type="perspective"><film type="hdrfilm">{}</film></sensor>'


def spectrum(filename: str) -> str:
    return f'<bsdf type="diffuse"><spectrum name="reflectance" filename="{filename}"/></bsdf>'


def folder(name: str) -> str:
    return f'<path value="{name}"/>'


def part(*body: str) -> bytes:
    return scene(*body, sensor="")


def size(*values: object, tag: str = "integer", names: tuple[str, ...] = ("width",)) -> str:
    pairs = zip(names, values, strict=True)
    return FILM.format("".join(f'<{tag} name="{n}" value="{v}"/>' for n, v in pairs))


def chain(length: int) -> dict[str, bytes]:
    links = {f"{n}.xml": part(include(f"{n + 1}.xml")) for n in range(length)}
    return {"scene.xml": scene(include("0.xml")), **links, f"{length}.xml": part()}


IN_S = include("s/a.xml")


def files(top: bytes, *names: str) -> dict[str, bytes]:
    """A scene, and files of these names that are as they should be."""
    kinds = {"ply": PLY, "spd": SPECTRUM, "xml": part()}
    return {"scene.xml": top, **{name: kinds[name[-3:]] for name in names}}


def via(included: bytes, *names: str) -> dict[str, bytes]:
    """The same of a scene that includes this one in a folder."""
    return {"s/a.xml": included, **files(scene(IN_S), *names)}


#: Each a scene by its files; Mitsuba loads the first group and refuses the second.
CASES: dict[str, Mapping[str, bytes]] = {
    # Plugins look along the scene's own folders, wherever they are written.
    "mesh beside the scene": {"scene.xml": scene(mesh("m.ply")), "m.ply": PLY},
    "mesh from a part, beside the scene": via(part(mesh("m.ply")), "m.ply"),
    "mesh from a part, beside the part": via(part(mesh("m.ply")), "s/m.ply"),
    "mesh in a path": {"scene.xml": scene(folder("p"), mesh("m.ply")), "p/m.ply": PLY},
    "mesh in a path that comes later": files(scene(mesh("m.ply"), folder("p")), "p/m.ply"),
    "mesh in a part's path": via(part(folder("p"), mesh("m.ply")), "s/p/m.ply"),
    "mesh in another case": {"scene.xml": scene(mesh("M.ply")), "m.ply": PLY},
    "mesh up from nowhere": {"scene.xml": scene(mesh("no/../m.ply")), "m.ply": PLY},
    "mesh up from somewhere": files(scene(mesh("p/../m.ply")), "m.ply") | {"p/x": b""},
    "mesh with odd slashes": {"scene.xml": scene(mesh(".//p//m.ply")), "p/m.ply": PLY},
    "mesh with a space": {"scene.xml": scene(mesh(" m.ply")), "m.ply": PLY},
    "mesh with an accent": {"scene.xml": scene(mesh("é.ply")), "é.ply": PLY},
    "mesh with a character reference": {"scene.xml": scene(mesh("&#109;.ply")), "m.ply": PLY},
    # Includes look in their own folder, then along the folders so far.
    "include beside a part": via(part(include("b.xml")), "s/b.xml"),
    "include beside the scene, from a part": via(part(include("b.xml")), "b.xml"),
    "include beside the middle": via(part(include("t/c.xml")), "s/b.xml")
    | {"s/t/c.xml": part(include("b.xml"))},
    "include in the middle's path": via(part(folder("q"), include("t/c.xml")), "s/q/b.xml")
    | {"s/t/c.xml": part(include("b.xml"))},
    "include in a path that comes later": files(scene(include("b.xml"), folder("p")), "p/b.xml"),
    "include in a path that has ended": files(scene(IN_S, include("b.xml")), "s/p/b.xml")
    | {"s/a.xml": part(folder("p"))},
    "include's path beside the scene": via(part(folder("q"), include("b.xml")), "q/b.xml"),
    "include of the right one of two": {  # the other one does not load
        "scene.xml": scene(folder("p"), include("b.xml")),
        "b.xml": part(),
        "p/b.xml": part(mesh("no.ply")),
    },
    "include of the wrong one of two": files(scene(folder("p"), include("b.xml")), "p/b.xml")
    | {"b.xml": part(mesh("no.ply"))},
    "includes as deep as they go": chain(13),
    "includes one deeper": chain(14),
    # Spectra look along the folders so far, and not beside the part.
    "spectrum beside the scene": {"scene.xml": scene(spectrum("a.spd")), "a.spd": SPECTRUM},
    "spectrum beside a part": via(part(spectrum("a.spd")), "s/a.spd"),
    "spectrum beside the scene, from a part": via(part(spectrum("a.spd")), "a.spd"),
    "spectrum beside the middle": via(part(include("t/c.xml")), "s/a.spd")
    | {"s/t/c.xml": part(spectrum("a.spd"))},
    "spectrum in a part's path": via(part(folder("q"), spectrum("a.spd")), "s/q/a.spd"),
    "spectrum in a path that comes later": files(scene(spectrum("a.spd"), folder("p")), "p/a.spd"),
    "spectrum in a path that has ended": files(scene(IN_S, spectrum("a.spd")), "s/p/a.spd")
    | {"s/a.xml": part(folder("p"))},
    # Parameters
    "default ahead of its use": files(
        scene('<default name="m" value="m"/>', mesh("$m.ply")), "m.ply"
    ),
    "default behind its use": files(
        scene(mesh("$m.ply"), '<default name="m" value="m"/>'), "m.ply"
    ),
    "default from a part": files(scene(include("a.xml"), mesh("$m.ply")), "m.ply")
    | {"a.xml": part('<default name="m" value="m"/>')},
    "default of a default": files(
        scene('<default name="a" value="m"/><default name="b" value="$a.ply"/>').replace(
            b"</scene>", mesh("$b").encode() + b"</scene>"
        ),
        "m.ply",
    ),
    "parameter whose name begins another's": files(
        scene('<default name="a" value="x"/><default name="ab" value="m"/>').replace(
            b"</scene>", mesh("$ab.ply").encode() + b"</scene>"
        ),
        "m.ply",
    ),
    "parameter with letters behind it": files(
        scene('<default name="a" value="m"/>', mesh("$ab.ply")), "mb.ply"
    ),
    "dollar escaped": {"scene.xml": scene(mesh(r"a\$b.ply")), "a$b.ply": PLY},
    "parameter as a property's name": files(
        scene(
            '<default name="n" value="filename"/>',
            '<shape type="ply"><string name="$n" value="no.ply"/></shape>',
        )
    ),
    # Films
    "film of a size": {"scene.xml": scene(sensor=size(5, 7, names=("width", "height")))},
    "film's size with spaces": {"scene.xml": scene(sensor=size(" 20 "))},
    "film's size with a plus": {"scene.xml": scene(sensor=size("+20"))},
    "film's size a float": {"scene.xml": scene(sensor=size("20", tag="float"))},
    "film's size with a fraction": {"scene.xml": scene(sensor=size("20.0"))},
    "film's size a string": {"scene.xml": scene(sensor=size("20", tag="string"))},
    "film's size negative": {"scene.xml": scene(sensor=size("-20"))},
    "film's crop off the film": files(
        scene(sensor=size(9, 1, 9, names=("width", "crop_offset_x", "crop_width")))
    ),
    "film's crop": files(
        scene(sensor=size(9, 1, 8, names=("width", "crop_offset_x", "crop_width")))
    ),
    "film's crop in the old spelling": files(
        scene(sensor=size(9, 4, names=("width", "cropWidth"))).replace(b"3.0.0", b"0.6.0")
    ),
    "film by reference": files(
        scene(
            '<film type="hdrfilm" id="f"><integer name="width" value="20"/></film>',
            sensor='<sensor type="perspective"><ref id="f"/></sensor>',
        )
    ),
    "film by alias": files(
        scene(
            '<alias id="f" as="g"/><sensor type="perspective"><ref id="g"/></sensor>',
            sensor='<film type="hdrfilm" id="f"><integer name="width" value="20"/></film>',
        )
    ),
    "film from a part": files(
        scene(sensor='<sensor type="perspective"><include filename="f.xml"/></sensor>')
    )
    | {"f.xml": b'<film version="3.0.0" type="hdrfilm"><integer name="width" value="20"/></film>'},
    "film from a part that is a scene": files(
        scene(sensor='<sensor type="perspective"><include filename="f.xml"/></sensor>')
    )
    | {"f.xml": part('<film type="hdrfilm"><integer name="width" value="20"/></film>')},
    "sensor from a part, ahead of the scene's": files(scene(include("s.xml") + size(30), sensor=""))
    | {"s.xml": part(size(20))},
    "sensor on a shape": files(
        scene(
            '<shape type="sphere"><sensor type="irradiancemeter"><film type="hdrfilm">'
            '<integer name="width" value="3"/><rfilter type="box"/></film></sensor></shape>'
            + size(9),
            sensor="",
        )
    ),
    "sensor of sensors": files(
        scene(
            f'<sensor type="batch">{size(5)}{size(5)}<film type="hdrfilm">'
            '<integer name="width" value="10"/></film></sensor>' + size(9),
            sensor="",
        )
    ),
    "sensor in a scene in the scene": files(
        scene(f'<scene type="scene">{size(5)}</scene>' + size(9), sensor="")
    ),
    "many sensors": {"scene.xml": scene(sensor="".join(size(n) for n in range(1, 13)))},
}

_LOAD_ALL = """
import json, sys
import mitsuba as mi
mi.set_variant("scalar_rgb")
mi.set_log_level(mi.LogLevel.Error)
seen = {}
for name, entry in json.load(sys.stdin).items():
    try:
        scene = mi.load_file(entry)
    except Exception as error:
        seen[name] = None
    else:
        seen[name] = [list(sensor.film().crop_size()) for sensor in scene.sensors()]
print("\\n" + json.dumps(seen))
"""


@pytest.fixture(scope="module")
def mitsubas(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[list[int]] | None]:
    """For each case the sizes of the sensors' images, or None where Mitsuba does not load it."""
    entries = {}
    for name, files in CASES.items():
        top = tmp_path_factory.mktemp("scene")
        for file, content in files.items():
            (top / file).parent.mkdir(parents=True, exist_ok=True)
            (top / file).write_bytes(content)
        entries[name] = str(top / "scene.xml")
    process = subprocess.run(
        [sys.executable, "-c", _LOAD_ALL],
        input=json.dumps(entries),
        capture_output=True,
        text=True,
        check=True,
        cwd=tmp_path_factory.mktemp("elsewhere"),
    )
    return json.loads(process.stdout.splitlines()[-1])


@pytest.mark.parametrize("name", CASES)
def test_the_check_agrees_with_mitsuba(name: str, mitsubas: dict[str, list[list[int]] | None]):
    archive = zipped(dict(CASES[name]))
    expected = mitsubas[name]
    if expected is None:
        with pytest.raises(BundleError):
            inspect_bundle(archive)
        return
    summaries = [inspect_bundle(archive, sensor=index) for index in range(len(expected))]
    assert [[summary.width, summary.height] for summary in summaries] == expected
    assert summaries[0].sensors == len(expected)


def test_the_known_plugins_are_those_that_mitsuba_makes() -> None:
    # Of what is a library, Mitsuba knows what it makes; what is in Python says its name
    program = (
        "import json, mitsuba as mi; mi.set_variant('scalar_rgb');"
        "kinds = mi.PluginManager.instance().plugin_type;"
        "print(mi.__path__[0]);"
        f"print(json.dumps([n for n in {known_plugins()} if kinds(n) == mi.ObjectType.Unknown]))"
    )
    said = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    ).stdout
    package, unknown = said.splitlines()
    registers = re.compile(r"""mi\.register_integrator\(\s*['"](\w+)""")
    in_python = {
        name
        for file in Path(package, "python").rglob("*.py")
        for name in registers.findall(file.read_text())
    }
    assert set(json.loads(unknown)) == in_python
    assert {"path", "sphere", "hdrfilm", "d65"} <= set(known_plugins())
    assert "own" in known_plugins(["own"])


def test_mitsuba_would_load_a_plugin_from_the_scenes_folder(tmp_path: Path):
    """Why a bundle may hold no library: this one is not even valid, and yet it is opened."""
    (tmp_path / "plugins").mkdir()
    (tmp_path / "plugins" / "sphere.so").write_bytes(b"code")
    (tmp_path / "scene.xml").write_bytes(scene('<shape type="sphere"/>'))
    code = "import mitsuba as mi, sys; mi.set_variant('scalar_rgb'); mi.load_file(sys.argv[1])"
    process = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path / "scene.xml")],
        capture_output=True,
        text=True,
        check=False,
    )
    assert process.returncode != 0
    assert f'Error while loading plugin "{tmp_path}/plugins/sphere.so"' in process.stderr
