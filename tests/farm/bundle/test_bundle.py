"""What the check lets through, and every kind of upload that it refuses."""

import copy
import gzip
import io
import random
import re
import stat
import struct
import tracemalloc
import zipfile
import zlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from plateau.farm.bundle import (
    CODES,
    BundleError,
    BundleLimits,
    SceneSummary,
    inspect_bundle,
    known_plugins,
)
from tests.support.scenes.bundles import PLY, include, link, mesh, scene, zipped

FILM = '<sensor type="perspective"><film type="hdrfilm">{}</film></sensor>'


def film(*properties: str) -> bytes:
    return scene(sensor=FILM.format("".join(properties)))


def integer(name: str, value: object) -> str:
    return f'<integer name="{name}" value="{value}"/>'


# What is good


def test_a_single_xml_is_a_scene(tmp_path: Path):
    path = tmp_path / "upload"
    path.write_bytes(film(integer("width", 320), integer("height", 200)))
    summary = inspect_bundle(path)
    assert summary == SceneSummary(
        kind="xml",
        renderer="mitsuba",
        entry="scene.xml",
        files=1,
        bytes_unpacked=path.stat().st_size,
        width=320,
        height=200,
        sensors=1,
    )


def test_a_stream_is_read_from_its_start_and_left_open():
    stream = zipped({"scene.xml": scene()})
    stream.read()
    inspect_bundle(stream)
    inspect_bundle(stream)
    assert not stream.closed


@pytest.mark.parametrize(
    ("files", "entry"),
    [
        (["scene.xml", "other.xml"], "scene.xml"),
        (["room/scene.xml", "room/other.xml"], "room/scene.xml"),
        (["room/scene.xml", "room/other.xml", "__MACOSX/room/._scene.xml"], "room/scene.xml"),
        (["one.xml"], "one.xml"),
        (["Scene.XML"], "Scene.XML"),
        (["a/main.xml", "a/old/main.xml", "b/c/d.xml"], "a/main.xml"),
    ],
)
def test_the_scene_is_found_by_its_name_or_its_level(files: list[str], entry: str):
    assert inspect_bundle(zipped(dict.fromkeys(files, scene()))).entry == entry


def test_an_included_file_is_not_taken_for_the_scene():
    part = ('<path value="$there"/>', include("one.xml"))
    files = {
        "deep/er/main.xml": scene(include("../../scene.xml"), include("../part.xml")),
        "scene.xml": scene(sensor=""),
        "deep/part.xml": scene('<default name="there" value="../parts"/>', *part, sensor=""),
        "parts/one.xml": scene(sensor=""),
    }
    assert inspect_bundle(zipped(files)).entry == "deep/er/main.xml"


def test_a_broken_xml_beside_the_scene_does_no_harm():
    files = {"scene.xml": scene(), "notes.xml": b"<notes>", "other.xml": b"<?xml version='1.0'?>"}
    files |= {"text.xml": f"<text>{random.Random(0).randbytes(2**20).hex()}</text>".encode()}
    assert inspect_bundle(zipped(files)).entry == "scene.xml"


def test_a_name_in_utf8_that_does_not_say_so_is_read_as_utf8():
    """macOS and others write these; the archive's flag is not set."""
    content = zipped({"scene.xml": scene(mesh("né.ply")), "nXX.ply": PLY}).getvalue()
    summary = inspect_bundle(io.BytesIO(content.replace(b"nXX.ply", "né.ply".encode())))
    assert summary.files == 2


def test_parameters_choose_files_and_the_film():
    files = {
        "scene.xml": scene(
            '<default name="mesh" value="a"/>',
            mesh("$mesh.ply"),
            sensor='<default name="w" value="10"/><default name="width" value="20"/>'
            + FILM.format(integer("width", "$width") + integer("height", "$w")),
        ),
        "b.ply": PLY,
    }
    summary = inspect_bundle(zipped(files), parameters={"mesh": "b", "w": "7"})
    assert (summary.width, summary.height) == (20, 7)
    assert summary.parameters == {"mesh": "a", "w": "10", "width": "20"}


def test_any_plugin_may_be_asked_for_where_nobody_says_which_there_are():
    """What a plugin does with its values is Mitsuba's business, in a child process."""
    body = '<shape type="no_such_shape"><string name="note" value="3/4 of it"/></shape>'
    assert inspect_bundle(io.BytesIO(scene(body))).sensors == 1


def test_limits_are_inclusive():
    upload = zipped({"scene.xml": scene(mesh("a.ply")), "a.ply": PLY})
    size = len(upload.getvalue())
    unpacked = inspect_bundle(upload).bytes_unpacked
    exact = BundleLimits(
        max_bytes=size,
        max_entries=2,
        max_unpacked_bytes=unpacked,
        max_xml_bytes=unpacked - len(PLY),
        max_xml_depth=3,
        max_xml_elements=4,
        max_pixels=768 * 576,
        max_name_bytes=len("scene.xml"),
        max_folder_depth=0,
    )
    inspect_bundle(upload, limits=exact)


# What is refused


@dataclass
class Bad:
    """An upload that is refused, the code, and what the message has to say."""

    code: str
    upload: io.BytesIO
    says: str
    file: str | None = None
    line: int | None = None
    kwargs: dict[str, Any] = field(default_factory=dict)


LATIN = io.BytesIO(scene("<!-- Größe -->").decode().encode("latin-1"))
TAR = bytes(257) + b"ustar\0" + bytes(249)


def xml(*body: str) -> io.BytesIO:
    return io.BytesIO(scene(*body))


def entry(name: str | zipfile.ZipInfo, content: bytes = b"") -> io.BytesIO:
    return zipped({"scene.xml": scene(), name: content})


OLD = b"""<scene version="0.6.0"><integrator type="path"><integer name="maxDepth" value="8"/>\
</integrator>
<sensor type="perspective"><transform name="toWorld"><lookAt origin="0,0,5"/></transform>
<film type="ldrfilm"><string name="toneMappingMethod" value="gamma"/></film></sensor>
<bsdf type="ward"/><bsdf type="diffuse"><spectrum name="reflectance" value="0.1, 0.2, 0.3"/></bsdf>
<emitter type="constant"><spectrum name="radiance" value="400:1, 700:2"/></emitter>
<emitter type="sunsky"><transform name="toWorld"/></emitter><emitter type="sunsky"/></scene>"""
OLD_LISTED = (
    "Mitsuba '0.6.0'.*Change: line 2, <lookAt>: write <lookat>; line 3, 'ldrfilm': use hdrfilm; "
    "line 3, 'toneMappingMethod': delete it; line 4, 'ward': use principled; "
    "line 4, <spectrum> with three numbers: write <rgb>; line 6, sunsky: put <rotate.*y$"
)


def binary_ply(order: str, *faces: tuple[int, ...]) -> bytes:
    kind = {"<": "little", ">": "big"}[order]
    header = PLY.partition(b"0 0 0")[0].replace(b"ascii", f"binary_{kind}_endian".encode())
    header = header.replace(b"face 1", f"face {len(faces)}".encode())
    corners = [struct.pack(f"{order}B{len(one)}i", len(one), *one) for one in faces]
    return header + struct.pack(f"{order}9f", *range(9)) + b"".join(corners)


def serialized(vertex: int) -> bytes:
    mesh = struct.pack("<I5sQQ9f3I", 0x1000, b"mesh", 3, 1, *range(9), 0, 1, vertex)
    return struct.pack("<HH", 0x041C, 4) + zlib.compress(mesh) + struct.pack("<QI", 0, 1)


def openexr(*channels: str) -> bytes:
    listed = b"".join(one.encode() + b"\0" + bytes(16) for one in channels) + b"\0"
    header = b"channels\0chlist\0" + struct.pack("<I", len(listed)) + listed
    return b"\x76\x2f\x31\x01\2\0\0\0" + header + b"\0"


def forged(**changes: object) -> io.BytesIO:
    """A scene whose mesh has a false record in the archive's directory."""

    def forge(records: list[zipfile.ZipInfo]) -> None:
        for name, value in changes.items():
            setattr(records[1], name, value)

    return zipped({"scene.xml": scene(), "a.ply": PLY}, forge=forge)


def overlapping() -> io.BytesIO:
    """An archive whose entries all unpack from the same bytes."""

    def forge(records: list[zipfile.ZipInfo]) -> None:
        for number in range(50):
            twin = copy.copy(records[1])
            twin.filename = f"{number}.bin"
            records.append(twin)

    return zipped({"scene.xml": scene(), "x.bin": bytes(500)}, zipfile.ZIP_STORED, forge)


def commented() -> io.BytesIO:
    """Few entries, and a directory of more than a megabyte."""

    def forge(records: list[zipfile.ZipInfo]) -> None:
        for record in records:
            record.comment = bytes(65_000)

    return zipped({f"{number}.bin": b"" for number in range(20)}, forge=forge)


def renamed(name: bytes, before: bytes = b"NAME") -> io.BytesIO:
    """An archive with a name that zipfile would not write."""
    content = zipped({"scene.xml": scene(), before.decode(): b""}).getvalue()
    assert len(name) == len(before)
    return io.BytesIO(content.replace(before, name))


def wide(depth: int, width: int) -> io.BytesIO:
    """Includes inside includes: small, and read width^depth times."""
    files = {"scene.xml": scene(*[include("1.xml")] * width)}
    for level in range(1, depth):
        files[f"{level}.xml"] = scene(*[include(f"{level + 1}.xml")] * width, sensor="")
    files[f"{depth}.xml"] = scene(sensor="")
    return zipped(files)


def sensors(includes: int, count: int) -> io.BytesIO:
    return zipped(
        {
            "scene.xml": scene(*[include("sensors.xml")] * includes),
            "sensors.xml": scene(*['<sensor type="perspective"/>'] * count),
        }
    )


def names(count: int) -> io.BytesIO:
    """One file by many names."""
    return zipped({"scene.xml": scene(*[mesh("./" * n + "a.ply") for n in range(count)]), **MESH})


def chain(length: int) -> io.BytesIO:
    files = {f"{n}.xml": scene(include(f"{n + 1}.xml"), sensor="") for n in range(length)}
    return zipped({"scene.xml": scene(include("0.xml")), **files, f"{length}.xml": scene()})


def defaults(count: int) -> list[str]:
    return [f'<default name="p{number}" value=""/>' for number in range(count)]


def laughs(depth: int) -> list[str]:
    """Defaults that are each twice the one before."""
    doubled = [
        f'<default name="p{n}" value="$p{n - 1}$p{n - 1}"/>' for n in range(100, 100 + depth)
    ]
    return ['<default name="p99" value="ha"/>', *doubled]


def many_attributes(count: int) -> list[str]:
    return ["<a ", *(f'a{number}=""' for number in range(count)), "/>"]


def searching(count: int) -> io.BytesIO:
    """Many folders, and many files each looked for in all of them."""
    folders = {f"{number}/x": b"" for number in range(count)}
    paths = [f'<path value="{number}"/>' for number in range(count)]
    return zipped({"scene.xml": scene(*paths, *[mesh("a.ply")] * count), **folders, "a.ply": PLY})


def limits(**given: int) -> dict[str, Any]:
    return {"limits": BundleLimits(**given)}


def given(**parameters: str) -> dict[str, Any]:
    return {"parameters": parameters}


TEXTURE = '<default name="texture" value="a.ply"/>'
ENTITY = b'<!DOCTYPE scene [<!ENTITY x "y">]>'
MESH = {"a.ply": PLY}
TEXTURE_OF = '<texture type="bitmap"><string name="filename" value="wood"/></texture>'
SERIALIZED = '<shape type="serialized"><string name="filename" value="a"/></shape>'

BAD = [
    # The upload
    Bad("empty", io.BytesIO(), "upload is empty"),
    Bad("empty", zipped({}), "no files"),
    Bad("too-large", xml(), "bytes; 10 are allowed", kwargs=limits(max_bytes=10)),
    Bad("not-a-scene", io.BytesIO(b"\x89PNG\r\n"), r"a PNG image \(a scene is a Mitsuba XML, an"),
    Bad("not-a-scene", io.BytesIO(gzip.compress(scene())), "XML compressed by gzip; unpack it"),
    Bad("not-a-scene", io.BytesIO(gzip.compress(TAR)), "a tar archive compressed by gzip"),
    Bad("not-a-scene", io.BytesIO(TAR), "a tar archive; unpack it"),
    Bad("not-a-scene", io.BytesIO(b"Rar!\x1a\x07\1\0"), "a RAR archive"),
    Bad("not-a-scene", io.BytesIO(b"\x28\xb5\x2f\xfd" + bytes(99)), "a Zstandard file"),
    Bad("not-a-scene", io.BytesIO(b"\n<!doctype HTML><html/>"), "a web page"),
    Bad("not-a-scene", io.BytesIO(b"<shape/>"), "<shape>, not <scene>", "scene.xml", 1),
    Bad("not-a-scene", zipped(MESH), "no scene: an"),
    Bad("not-a-scene", zipped({"a.xml": b"<bsdf/>", "b.xml": b"oops"}), "no scene: an"),
    Bad("ambiguous-scene", zipped({"a.xml": scene(), "b.xml": scene()}), r"a\.xml, b\.xml"),
    # The archive's directory
    Bad("zip-malformed", io.BytesIO(b"PK\x03\x04 and so on"), "is damaged"),
    Bad("zip-malformed", io.BytesIO(zipped(MESH).getvalue()[:-30]), "is damaged"),
    Bad("zip-malformed", renamed(b"\xc3\x28", "é".encode()), "is damaged"),
    Bad(
        "too-many-entries",
        entry("b"),
        "2 entries, folders included; 1 are",
        kwargs=limits(max_entries=1),
    ),
    Bad(  # folders that have no entries of their own
        "too-many-entries",
        zipped({"scene.xml": scene(), "/".join("abcdefg"): b""}),
        "8 entries",
        kwargs=limits(max_entries=7),
    ),
    Bad("too-many-entries", commented(), "directory takes", kwargs=limits(max_entries=100)),
    Bad("zip-encrypted", forged(flag_bits=0x1), "without a password", "a.ply"),
    Bad("zip-method", zipped({"scene.xml": scene()}, zipfile.ZIP_BZIP2), "deflated", "scene.xml"),
    Bad("zip-bomb", entry("a.ply", bytes(2**21)), "ratio of 200", "a.ply"),
    Bad("zip-bomb", entry("a"), "to 60 bytes; 20 are", kwargs=limits(max_unpacked_bytes=20)),
    Bad("zip-bomb", zipped({f"{n}.bin": bytes(2**20) for n in range(65)}), "67108864 are"),
    Bad("zip-bomb", forged(file_size=9 * 2**30, compress_size=2**30), "to 9663676476 bytes"),
    Bad("zip-bomb", forged(compress_size=10**6), "overlap"),
    Bad("zip-bomb", overlapping(), "overlap"),
    # Names
    Bad("path-escape", entry("/etc/passwd"), "leaves the bundle"),
    Bad("path-escape", entry("a/../../b.ply"), "leaves the bundle"),
    Bad("path-escape", entry("a\\..\\..\\b.ply"), "leaves the bundle"),
    Bad("path-escape", entry("C:/a.ply"), "leaves the bundle"),
    Bad("entry-name", entry("a\\b.ply"), "backslash"),
    Bad("entry-name", entry("a.ply:stream"), "colon"),
    Bad("entry-name", entry("a\nb.ply"), "control character"),
    Bad("entry-name", entry("a\u202eylp.b"), "control character"),
    Bad("entry-name", renamed(b"A\0.."), "control character"),
    Bad("entry-name", renamed(b"A\xff.."), "not UTF-8"),
    Bad("entry-name", renamed(b"\n\xff.."), r"entry '\\n\\xa0\.\.' is not UTF-8"),
    Bad("entry-name", entry("a//b.ply"), "empty component"),
    Bad("entry-name", entry("./a.ply"), "empty component"),
    Bad("entry-name", entry("a" * 256), "too long"),
    Bad("entry-name", entry("/".join(["é" * 100] * 6)), "too long"),
    Bad("entry-name", entry("/".join("a" * 34)), "under more than 32 folders"),
    Bad("duplicate-entry", zipped([("scene.xml", b""), ("scene.xml", scene())]), "twice"),
    Bad("duplicate-entry", entry("SCENE.xml"), "in case alone", "SCENE.xml"),
    Bad("duplicate-entry", zipped({"scene.xml": scene(), "é": b"", "e\u0301": b""}), "case"),
    Bad(  # which casefold alone takes apart, in another order
        "duplicate-entry",
        zipped({"scene.xml": scene(), "\u1fb7": b"", "\u03b1\u0345\u0342": b""}),
        "case",
    ),
    Bad("duplicate-entry", zipped({"a": b"", "a/scene.xml": scene()}), "a file and a folder", "a"),
    # Kinds
    Bad("entry-type", zipped({"scene.xml": scene(), link("a"): b"/etc"}), "a link", "a"),
    Bad("entry-type", zipped({"scene.xml": scene(), link(" "): b""}), "' ': it is a link", " "),
    Bad("entry-type", zipped({"scene.xml": scene(), link("a/"): b"/etc"}), "a link", "a/"),
    Bad("entry-type", entry(link("a", stat.S_IFCHR)), "neither a plain file", "a"),
    Bad("entry-type", entry(link("a", stat.S_IFDIR)), "neither a plain file", "a"),
    Bad("entry-type", entry("a/", b"content"), "with contents", "a/"),
    Bad("native-code", entry("plugins/sphere.so"), "shared library", "plugins/sphere.so"),
    Bad("native-code", entry("x.DLL"), "shared library", "x.DLL"),
    Bad("native-code", entry("x.dylib"), "shared library", "x.dylib"),
    # XML
    Bad("xml-malformed", io.BytesIO(b"<scene>\n<shape>\n</scene>"), "mismatched", "scene.xml", 3),
    Bad("xml-malformed", io.BytesIO(scene() + scene()), "junk", "scene.xml"),
    Bad("xml-malformed", io.BytesIO(scene('<a b="1" b="2"/>')), "duplicate", "scene.xml", 2),
    Bad("xml-malformed", xml('<a b="&y;"/>'), "undefined entity", "scene.xml", 2),
    Bad("xml-encoding", io.BytesIO(b'<scene v="\xff"/>'), "0xff is no UTF-8", "scene.xml", 1),
    Bad("xml-entity", io.BytesIO(ENTITY + scene('<a b="&x;"/>')), "DOCTYPE", "scene.xml", 1),
    Bad(
        "xml-entity",
        io.BytesIO(b'\n<!DOCTYPE scene SYSTEM "file:///etc/passwd">' + scene()),
        "DOCTYPE",
        "scene.xml",
        2,
    ),
    Bad("xml-encoding", io.BytesIO(scene().decode().encode("utf-16")), "UTF-8", "scene.xml"),
    Bad("xml-encoding", LATIN, "0xf6 .* in Latin-1 it is 'ö'", "scene.xml", 2),
    Bad(
        "xml-encoding",
        io.BytesIO(b'<?xml version="1.0" encoding="latin-1"?>' + scene()),
        "UTF-8",
        "scene.xml",
    ),
    Bad("xml-depth", xml("<a>" * 64 + "</a>" * 64), "more than 64 deep", "scene.xml", 2),
    Bad("xml-too-large", xml(" " * 99), "99 bytes", kwargs=limits(max_xml_bytes=99)),
    Bad("xml-too-large", xml("<a/>" * 99), "99 elements", kwargs=limits(max_xml_elements=99)),
    Bad("xml-too-large", xml(f'<a b="{"x" * 2**20}"/>'), "a tag, or text, of", "scene.xml"),
    Bad("xml-too-large", xml(*many_attributes(2**17)), "a tag, or text, of", "scene.xml"),
    Bad("xml-too-large", wide(12, 2), "counted every", kwargs=limits(max_xml_elements=999)),
    Bad("xml-too-large", wide(12, 2), "counted every", kwargs=limits(max_xml_bytes=9999)),
    Bad("xml-too-large", wide(2, 40), "includes more than 1000 files", "scene.xml", 26),
    Bad("xml-too-large", sensors(20, 60), "1000 sensors and films", "sensors.xml"),
    Bad("xml-too-large", xml("<film/>" * 1001), "1000 sensors and films", "scene.xml", 2),
    Bad("xml-too-large", names(99), "98 different names", kwargs=limits(max_references=98)),
    Bad("xml-too-large", xml(*defaults(300)), "more than 256 parameters", "scene.xml", 258),
    Bad("xml-too-large", xml(*laughs(30)), "more than 65536 characters", "scene.xml"),
    Bad("xml-too-large", xml(r'<a b="\$' + "x" * 2**16 + '"/>'), "more than 65536 char"),
    Bad(
        "xml-too-large",
        xml(*defaults(100), *[r'<a b="\$"/>'] * 100),
        "parameters in takes too long",
        kwargs=limits(max_substitutions=9999),
    ),
    Bad("xml-too-large", searching(60), "takes too long", kwargs=limits(max_lookups=1000)),
    Bad("plugin-name", xml('<shape type="../x"/>'), "not the name of a", "scene.xml", 2),
    Bad(
        "plugin-name",
        xml('<default name="t" value="ply"/><shape type="$t"/>'),
        r"\.\./ply",
        kwargs=given(t="../ply"),
    ),
    Bad(
        "unknown-plugin",
        xml('<shape type="sfere"/>'),
        "no plugin of the type 'sfere'; did you mean 'sphere'",
        "scene.xml",
        2,
        kwargs=limits(plugins=known_plugins()),
    ),
    Bad(
        "unknown-plugin",
        xml('<default name="t" value="' + "x" * 9999 + '"/><bsdf type="$t"/>'),
        r"x'… \(PLATEAU_PLUGINS",
        kwargs=limits(plugins=known_plugins()),
    ),
    # References
    Bad("missing-file", xml(mesh("a.ply")), "single XML file; send a zip", "scene.xml", 2),
    Bad("missing-file", zipped({"scene.xml": scene("", mesh("a.ply"))}), "add it", "scene.xml", 3),
    Bad("missing-file", zipped({"scene.xml": scene('<path value="a"/>')}), "add it"),
    Bad("missing-file", zipped({"scene.xml": scene(mesh("A.ply")), **MESH}), r"'a.ply' \(case"),
    Bad(
        "missing-file", zipped({"scene.xml": scene(mesh("M\\Tent.ply")), "m/tent.ply": PLY}), "m/t"
    ),
    Bad(
        "missing-file", zipped({"scene.xml": scene(mesh("m/tnet.ply")), "m/tent.ply": PLY}), "m/te"
    ),
    Bad(
        "missing-file", zipped({"scene.xml": scene(mesh("ö.ply")), "o\u0308.ply": PLY}), r"o\\u0308"
    ),
    # What the files have
    *(
        Bad(
            "unreadable-file",
            zipped({"scene.xml": scene("", mesh("m/a.ply")), "m/a.ply": bad}),
            says,
        )
        for bad, says in {
            PLY[:-2] + b"3": "'m/a.ply' has 3 vertices, from 0 on, and face 0 names vertex 3",
            PLY[:-6] + b"0 -1 2": "names vertex -1",
            binary_ply("<", (0, 1, 2), (0, 70_000, 2)): "face 1 names vertex 70000",
            binary_ply(">", (0, 1, 2), (0, 70_000, 2)): "face 1 names vertex 70000",
            binary_ply("<", (0, 1, 2), (0, 1, 2, 1)): r"4 corners \(face 1\).* triangulate",
            PLY[:-8] + b"4 0 1 2 1": "4 corners",
            binary_ply("<", (0, 1, 2))[:-1]: "cut short: it has 0 of 1 faces",
            b"": "is empty",
            b"<html>404</html>": "is a web page",
            b"version https://git-lfs.github.com/spec/v1\n": "git lfs pull",
            b"II*\0": "a TIFF image, and no mesh",
        }.items()
    ),
    *(
        Bad("unreadable-file", zipped({"scene.xml": scene(TEXTURE_OF), "wood": bad}), says)
        for bad, says in {
            b"RIFF\0\0\0\0WEBP": "'wood' is a WebP image, which Mitsuba cannot read: convert",
            b"II*\0": "a TIFF image",
            b"\xff\xd8\xff\xc1\0\x11\x0c": "12 bits",
            b"\xff\xd8\xff\xe0\0\x02\xff\xc0\0\x14\x08\0\1\0\1\4": "4 channels",
            b"\xff\xd8\xff\xe0\1\0": "cut short",
            b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR": "cut short",
            openexr("Z"): "channels 'Z'",
            openexr("A", "B", "G", "R", "Z"): "channels 'A, B, G, R, Z'",
            openexr("left.A", "left.B", "left.G", "left.R"): "channels 'left.A, left",
        }.items()
    ),
    Bad(
        "unreadable-file",
        zipped(
            {
                "scene.xml": scene(
                    TEXTURE_OF.replace("texture", "emitter").replace("bitmap", "envmap")
                ),
                "wood": openexr("d.B", "d.G", "d.R"),
            }
        ),
        "channels 'd.B, d.G, d.R'",
    ),
    Bad(
        "unreadable-file", zipped({"scene.xml": scene(SERIALIZED), "a": serialized(9)}), "vertex 9"
    ),
    Bad("missing-file", zipped({"scene.xml": scene(mesh("a.ply/../a.ply")), **MESH}), "add it"),
    Bad("missing-file", zipped({"scene.xml": scene(mesh("a")), "a/b": b""}), "not a file"),
    Bad("missing-file", zipped({"scene.xml": scene(mesh("./" * 3000 + "a.ply")), **MESH}), "…"),
    Bad("missing-file", zipped({"scene.xml": scene('<path value="a"/>'), "a": b""}), "not a fold"),
    Bad("missing-file", xml('<spectrum name="x" filename="a.spd"/>'), "a.spd", "scene.xml", 2),
    Bad("old-scene", io.BytesIO(OLD), OLD_LISTED, "scene.xml", 2),
    Bad("path-escape", xml(mesh("../a.ply")), "leads out of", "scene.xml", 2),
    Bad("path-escape", xml(mesh("C:/a.ply")), "is a path of Windows", "scene.xml", 2),
    Bad("path-escape", xml(mesh("\\\\host\\a.ply")), "is a path of Windows", "scene.xml", 2),
    Bad("path-escape", xml('<path value=".."/>'), "leads out of", "scene.xml", 2),
    Bad("path-escape", xml(include("../a.xml")), "leads out of", "scene.xml", 2),
    Bad("path-escape", xml('<spectrum name="x" filename="/a"/>'), "leads out of", "scene.xml", 2),
    Bad("path-escape", xml('<string name="cache" value="/tmp/x"/>'), "looks like", "scene.xml", 2),
    Bad(  # up to the top and down again, by a name that the archive does not have
        "path-escape",
        zipped({"a/scene.xml": scene(mesh("../../a/a.ply")), "a/a.ply": PLY}),
        "leads out of",
    ),
    Bad(  # the second folder has it, but Mitsuba tries the first one first
        "path-escape",
        zipped({"a/b/scene.xml": scene('<path value="../.."/>', mesh("../a.ply")), "a/a.ply": PLY}),
        "leads out of",
    ),
    Bad(
        "path-escape",
        zipped({"scene.xml": scene(TEXTURE, mesh("$texture")), **MESH}),
        "'../a.ply' leads out of",
        kwargs=given(texture="../a.ply"),
    ),
    Bad("include-cycle", zipped({"scene.xml": scene(include("scene.xml"))}), "→ scene.xml"),
    Bad(
        "include-cycle",
        zipped({"scene.xml": scene(include("a.xml")), "a.xml": scene(include("./scene.xml"))}),
        "scene.xml → a.xml → scene.xml",
        "a.xml",
        2,
    ),
    Bad(
        "include-cycle",
        zipped(
            {
                "scene.xml": scene(include("d" * 200 + ".xml")),
                "d" * 200 + ".xml": scene(include("d" * 200 + ".xml")),
            }
        ),
        r"itself: scene.xml → …d{96}\.xml → …d{96}\.xml$",
    ),
    Bad("include-depth", chain(14), "more than 15 deep", "13.xml", 2),
    # Parameters
    Bad("undefined-parameter", xml(mesh("$m")), r"\$m has no value", "scene.xml", 2),
    Bad(
        "undefined-parameter",
        xml('<default name="a&#10;b" value="1"/>', '<a b="$c"/>'),
        r"parameters: 'a\\nb'",
    ),
    Bad("undefined-parameter", xml('<a b="$b"/>', '<default name="b" value="1"/>'), "ahead of"),
    Bad(
        "unknown-parameter",
        xml('<default name="depth" value="1"/><a b="$depth"/>'),
        "'dept'; did you mean 'depth'.*parameters: depth",
        kwargs=given(dept="2"),
    ),
    Bad("unknown-parameter", xml(), "the scene has none", kwargs=given(depth="2")),
    Bad(
        "unknown-parameter",
        xml('<default name="o\u0308" value="1"/><a b="$o\u0308"/>'),
        r"that is 'o\\u0308', and not '\\xf6'",
        kwargs=given(ö="2"),
    ),
    Bad(
        "unknown-parameter",
        xml('<default name="depth" value="1"/>'),
        "does not use a parameter 'depth'",
        kwargs=given(depth="2"),
    ),
    Bad(
        "bad-parameter",
        xml(),
        "300 parameters; 256 are",
        kwargs=given(**{f"p{number}": "" for number in range(300)}),
    ),
    Bad("bad-parameter", xml(), "no parameter's name", kwargs=given(**{"a b": "2"})),
    Bad("bad-parameter", xml(), "control characters", kwargs=given(a="2\n")),
    Bad("bad-parameter", xml(), "control characters", kwargs=given(a="2" * 5000)),
    Bad("bad-parameter", xml(), r"\$ or a backslash", kwargs=given(a="$b")),
    # Films and sensors
    *(
        Bad("film-size", io.BytesIO(film(integer("width", value))), "integer", "scene.xml", 1)
        for value in ("0", "-5", "2.5", "+5", "1_0", "١", "ten", "", "nan", "0x10")
    ),
    Bad("film-size", io.BytesIO(film('<float name="width" value="5"/>')), "<float> '5'"),
    Bad("film-size", io.BytesIO(film(integer("width", 2**26))), "too large"),
    Bad("film-size", io.BytesIO(film(integer("width", "9" * 9999))), "too large"),
    Bad("film-size", io.BytesIO(film(integer("width", "0" * 10**6 + "x"))), "integer"),
    *(  # by the job's parameters, and by the scene's own
        Bad(
            "film-size",
            io.BytesIO(
                scene(
                    f'<default name="n" value="{value}"/>',
                    FILM.format(integer("width", "$n") + integer("height", "$n")),
                    sensor="",
                )
            ),
            "1000000×1000000 pixels is too large",
            kwargs=kwargs,
        )
        for value, kwargs in [("8", given(n="1000000")), ("1000000", {})]
    ),
    # What counts is behind more zeros than a reader might look at
    Bad("film-size", io.BytesIO(film(integer("width", f"{10**6:030}"))), "1000000×576 pixels"),
    Bad("film-size", io.BytesIO(film(integer("crop_offset_x", f"{9:030}"))), "crop window"),
    Bad("film-size", io.BytesIO(film(integer("crop_width", 0))), "crop_width"),
    Bad("film-size", io.BytesIO(film(integer("crop_offset_x", -1))), "crop_offset_x"),
    Bad("film-size", io.BytesIO(film(integer("crop_offset_x", 1))), "crop window"),
    Bad(
        "film-size",
        io.BytesIO(
            scene(sensor='<default name="w" value="9"/>' + FILM.format(integer("width", "$w")))
        ),
        "at least 1",
        "scene.xml",
        1,
        kwargs=given(w="0"),
    ),
    Bad("no-sensor", io.BytesIO(scene(sensor="")), "add a <sensor>"),
    Bad(
        "no-sensor", xml(), "no sensor 1; it has 1, and the first is sensor 0", kwargs={"sensor": 1}
    ),
    Bad("no-sensor", xml(), "no sensor -1", kwargs={"sensor": -1}),
]


@pytest.mark.parametrize("bad", BAD, ids=lambda bad: f"{bad.code}: {bad.says[:30]}")
def test_a_bad_upload_is_refused_with_its_reason(bad: Bad):
    with pytest.raises(BundleError) as caught:
        inspect_bundle(bad.upload, **bad.kwargs)
    error = caught.value
    assert error.code == bad.code
    assert re.search(bad.says, str(error)), str(error)
    if bad.file is not None:
        assert error.file == bad.file
        assert bad.file in str(error)
    if bad.line is not None:
        assert error.line == bad.line
        assert f"line {bad.line}" in str(error)


def test_every_code_is_tested():
    # In test_packing.py and test_scene_dict.py.
    elsewhere = {"unpackable-path", "unwritable-dict"}
    assert {bad.code for bad in BAD} | elsewhere == set(CODES)


class CountingStream(io.BytesIO):
    """An upload that knows how many bytes of it were read."""

    read_bytes = 0

    def read(self, size: int | None = -1, /) -> bytes:
        content = super().read(size)
        self.read_bytes += len(content)
        return content


def test_a_file_that_is_included_again_is_not_read_again():
    once, often = (
        CountingStream(
            zipped(
                {
                    "scene.xml": scene(*[include("a.xml")] * times),
                    "a.xml": scene(*[include("b.xml")] * 20, sensor=""),
                    "b.xml": scene(mesh("a.ply"), sensor=""),
                    **MESH,
                },
                zipfile.ZIP_STORED,
            ).getvalue()
        )
        for times in (1, 40)
    )
    inspect_bundle(once)
    inspect_bundle(often)
    longer_bytes = 39 * len(include("a.xml") + "\n")
    # Once to find the scene, once to read it, and a directory has the same entries
    assert often.read_bytes - once.read_bytes <= 3 * longer_bytes


@pytest.mark.parametrize("what", [mesh("a.ply"), '<spectrum name="x" filename="a.ply"/>'])
def test_a_name_that_is_met_again_takes_no_memory(what: str):
    """Given 724 bytes with 200,000 names of one file, of which 124 MB were made before."""
    upload = zipped(
        {
            "scene.xml": scene(*[include("a.xml")] * 200),
            "a.xml": scene(*[what] * 1000, sensor=""),
            **MESH,
        }
    )
    tracemalloc.start()
    try:
        assert inspect_bundle(upload).files == 3
        _, peak_bytes = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak_bytes < 4 * 2**20


def test_a_file_that_is_included_again_is_read_again_where_that_tells_more():
    """Given a default that the first reading leaves, and a sensor, it says other things then."""
    found = inspect_bundle(
        zipped(
            {
                "scene.xml": scene(*[include("a.xml")] * 3, sensor=""),
                "a.xml": scene(mesh("$m.ply"), '<default name="n" value="1"/>'),
                "b.xml": scene('<default name="m" value="a"/>', include("scene.xml"), sensor=""),
                **MESH,
            }
        )
    )
    assert (found.entry, found.sensors) == ("b.xml", 3)


def test_a_file_that_is_included_again_further_down_may_be_too_deep():
    """Given a chain that fits from the scene itself, it does not fit below another chain."""
    links = {f"{n}.xml": scene(include(f"{n + 1}.xml"), sensor="") for n in range(10)}
    down = {f"d{n}.xml": scene(include(f"d{n + 1}.xml"), sensor="") for n in range(8)}
    files = {**links, "10.xml": scene(sensor=""), **down}
    files["d8.xml"] = scene(include("0.xml"), sensor="")
    with pytest.raises(BundleError, match="more than 15 deep"):
        inspect_bundle(zipped({"scene.xml": scene(include("0.xml"), include("d0.xml")), **files}))
    assert inspect_bundle(zipped({"scene.xml": scene(include("0.xml")), **files})).files == 21


def test_an_archive_is_not_read_into_memory():
    """Given 32 MiB of texture, the check reads only the archive's directory and the XML."""
    files = {"scene.xml": scene(), "big.exr": bytes(2**25)}
    stream = CountingStream(zipped(files, zipfile.ZIP_STORED).getvalue())
    inspect_bundle(stream)
    assert stream.read_bytes < 200_000
