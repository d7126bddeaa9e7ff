"""Hostile uploads, as Hypothesis draws them: scenes, archives of scenes, and wrecks of both."""

import stat
from dataclasses import dataclass, field
from xml.sax.saxutils import quoteattr

from hypothesis import strategies as st

from tests.support.scenes.bundle_mutator import (
    DEFLATED,
    STORED,
    UTF8_NAME,
    VANDALISM,
    Entry,
    archive,
    vandalise,
)
from tests.support.scenes.bundles import PLY, PNG

#: Nobody may ever make this.
CANARY = "/tmp/plateau-canary"


@dataclass
class Upload:
    """What a stranger sends."""

    content: bytes = field(repr=False)
    parameters: dict[str, str]
    sensor: int
    #: what it was made of
    story: object


# ---------------------------------------------------------------------------------------------
# Values
# ---------------------------------------------------------------------------------------------

FILES = ["scene.xml", "part.xml", "a.ply", "tex/b.png", "deep/er/c.xml", "é.ply"]
GOOD_PATHS = [*FILES, "./a.ply", "tex/../a.ply", "deep/er/../../a.ply", "tex//b.png", "tex", "deep"]
BAD_PATHS = [
    *(CANARY, "/etc/passwd", "//host/share", "/", "//", "/./a.ply", "/proc/self/environ"),
    *("..", "../a.ply", "../../../../../../etc/passwd", "tex/../../a.ply", "a.ply/../../x"),
    *(
        "C:\\x",
        "C:/x",
        "c:",
        "\\\\host\\share\\x",
        "\\x",
        "..\\x",
        "tex\\..\\..\\x",
        "\\\\?\\C:\\x",
    ),
    *("~", "~/x", "~root/.ssh/id_rsa", "$HOME/x", "${HOME}", "%2e%2e/x", "..%2fx", "....//x"),
    *("file:///etc/passwd", "http://127.0.0.1/x", "data:text/xml,x", "a.ply::$DATA", "|id", "`id`"),
    *("", " ", ".", "./", "no.ply", "a.ply/", "a.ply/x", "tex/.", "A.PLY", "e\u0301.ply", "a.ply "),
    *("．．/x", "‥/x", "..∕x", "․․/x", "a\u202eylp.a", "\ufeffa.ply", "a.ply\u200b", "ａ.ply"),
    *("x" * 300, "x" * 5000, "./" * 2100 + "a.ply", "../" * 50 + "x", "tex/../" * 300 + "a.ply"),
    *("CON", "nul.ply", "a.ply.", "*", "?", "a;b", "a\nb", "a\tb", "a\rb"),
]
PATHS = st.sampled_from(GOOD_PATHS) | st.sampled_from(BAD_PATHS)
NUMBERS = st.sampled_from(
    [
        *("1", "7", "64", "0", "-1", "1000000", "67108864", "67108865", "4294967296", "9" * 40),
        *("00000000000000000000000000001", "0" * 25 + "1000000", "-" + "0" * 30, "9" * 4000),
        *("nan", "inf", "-inf", "1e999", "1e-999", "2.5", "+5", "0x10", "1_0", "١", "٣", "½", "²"),
        *("", " ", " 5 ", "\t5\n", "5\x85", "5\u2003", "- 5", "--5", "1,000", "true", "$w", "\\$w"),
    ]
)
NAMES = st.sampled_from(
    [
        *("filename", "width", "height", "crop_width", "crop_height", "crop_offset_x", "cropWidth"),
        *("crop_offset_y", "to_world", "w", "mesh", "", "x" * 200, "FileName", "filename ", "é"),
        *("path", "cache", "a\nb", "$w", "__proto__", "id"),
    ]
)
TEXTS = st.one_of(
    PATHS,
    NUMBERS,
    st.sampled_from(
        ["$w", "$mesh", "\\$w", "$", "$$", "$wx", "\\\\$w", "x" * 70_000, "$w" * 40_000]
    ),
    st.text(st.characters(codec="utf-8", exclude_categories=("Cs", "Cc")), max_size=12),
)
TYPES = st.sampled_from(
    [
        *("perspective", "hdrfilm", "ply", "sphere", "path", "rgb", "bitmap", "nosuch", ""),
        *("../x", "/tmp/x", "x.so", "a/b", "é", "ply\n", "$w", "x" * 300),
    ]
)
TAGS = st.sampled_from(
    [
        *(
            "sensor",
            "film",
            "shape",
            "bsdf",
            "texture",
            "emitter",
            "integrator",
            "sampler",
            "medium",
        ),
        *("scene", "string", "integer", "float", "boolean", "default", "include", "path", "ref"),
        *("alias", "spectrum", "rgb", "transform", "matrix", "translate", "scale", "lookat"),
        *("point", "vector", "volume", "rfilter", "phase", "nosuchtag", "é", "a" * 200),
    ]
)
ATTRIBUTES = st.sampled_from(
    [*("name", "value", "type", "id", "filename", "version", "as", "x", "é", "angle", "xmlns")]
)


# ---------------------------------------------------------------------------------------------
# XML
# ---------------------------------------------------------------------------------------------


def _element(tag: str, attributes: dict[str, str], inside: str = "") -> str:
    shown = "".join(f" {name}={quoteattr(value)}" for name, value in attributes.items())
    return f"<{tag}{shown}>{inside}</{tag}>"


def _named(tag: str, name: str, value: str) -> str:
    return _element(tag, {"name": name, "value": value})


ANY_ELEMENT = st.builds(
    _element, TAGS, st.dictionaries(ATTRIBUTES, TEXTS | TYPES | NAMES, max_size=3)
)
REFERENCES = st.one_of(
    PATHS.map(lambda to: _element("include", {"filename": to})),
    PATHS.map(lambda to: _element("path", {"value": to})),
    PATHS.map(lambda to: _element("spectrum", {"name": "x", "filename": to})),
    PATHS.map(lambda to: _element("shape", {"type": "ply"}, _named("string", "filename", to))),
    PATHS.map(lambda to: _element("emitter", {"type": "envmap"}, _named("string", "filename", to))),
    st.builds(lambda name, to: _named("string", name, to), NAMES, PATHS),
)
FILM_SIZES = st.lists(
    st.builds(_named, st.sampled_from(["integer", "float", "string", "ref"]), NAMES, NUMBERS)
    | st.builds(
        _named,
        st.just("integer"),
        st.sampled_from(["width", "height", "crop_width", "crop_offset_x"]),
        NUMBERS,
    ),
    max_size=3,
).map("".join)
SENSORS = st.builds(
    lambda sizes, of: _element("sensor", {"type": "perspective"}, _element("film", of, sizes)),
    FILM_SIZES,
    st.sampled_from([{"type": "hdrfilm"}, {"type": "hdrfilm", "id": "f"}, {"id": "f"}, {}]),
)
MATRICES = st.lists(NUMBERS, min_size=1, max_size=16).map(
    lambda numbers: _element(
        "transform", {"name": "to_world"}, _element("matrix", {"value": " ".join(numbers)})
    )
)
DEFAULTS = st.builds(
    lambda name, value: _named("default", name, value),
    st.sampled_from(["w", "mesh", "wx", ""]) | NAMES,
    TEXTS,
)
EXTREMES = st.sampled_from(
    [
        "<a>" * 70 + "</a>" * 70,
        "<a>" * 5000,
        "<a/>" * 600,
        "<a " + " ".join(f'b{n}=""' for n in range(2000)) + "/>",
        f'<string name="x" value="{"y" * 1_100_000}"/>',
        "<!--" + "x" * 100_000 + "-->",
        "<![CDATA[" + "]]" * 1000 + "]]>",
        "<?xml version='1.0'?>",
        "<?php x?>",
        '<a b="&x;"/>',
        '<a b="&#0;"/>',
        '<a b="&#xD800;"/>',
        '<a b="&#xFFFF;&#x10FFFF;&#10;&#13;&#9;"/>',
        '<a b="1" b="2"/>',
        "<a b=1/>",
        "</scene>",
        "<scene>",
        "\0",
        "\x01",
        "\ufffe",
        "".join(f'<default name="p{n}" value=""/>' for n in range(300)),
        '<default name="p0" value="ha"/>'
        + "".join(f'<default name="p{n + 1}" value="$p{n}$p{n}"/>' for n in range(30)),
        "".join(_element("include", {"filename": "part.xml"}) for _ in range(30)),
    ]
)
BODIES = st.lists(
    st.one_of(REFERENCES, REFERENCES, ANY_ELEMENT, SENSORS, MATRICES, DEFAULTS, EXTREMES),
    max_size=5,
).map("".join)
DECLARATIONS = st.sampled_from(
    [
        *("", "", "", '<?xml version="1.0"?>', '<?xml version="1.0" encoding="utf-8"?>', "\n \n"),
        *('<?xml version="1.0" encoding="latin-1"?>', '<?xml version="1.1"?>', "<?xml?>"),
        *('<?xml version="1.0" encoding="utf-16"?>', '<?xml version="1.0" encoding="utf-7"?>'),
        *("<!DOCTYPE scene>", '<!DOCTYPE scene SYSTEM "file:///etc/passwd">'),
        '<!DOCTYPE scene [<!ENTITY x SYSTEM "file:///etc/passwd">]>',
        '<!DOCTYPE a [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;"><!ENTITY c "&b;&b;&b;">]>',
        '<!DOCTYPE a [<!ENTITY % p SYSTEM "http://127.0.0.1/x"> %p;]>',
    ]
)
ENCODINGS = st.sampled_from(
    ["utf-8"] * 6 + ["utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "utf-32", "utf-7", "cp037"]
)


def _document(declaration: str, sensor: str, body: str, root: str, encoding: str) -> bytes:
    text = f'{declaration}<{root} version="3.0.0">{sensor}{body}</{root}>'
    return text.encode(encoding, "replace")


SCENES = st.builds(
    _document,
    DECLARATIONS,
    st.sampled_from(['<sensor type="perspective"/>', ""]) | SENSORS,
    BODIES,
    st.sampled_from(["scene"] * 9 + ["bsdf"]),
    ENCODINGS,
)
#: Nothing wrong but in the body: these come furthest.
PLAIN_SCENES = st.builds(
    _document,
    st.just(""),
    st.just('<default name="w" value="8"/><sensor type="perspective"/>') | SENSORS,
    st.lists(REFERENCES | MATRICES, max_size=2).map("".join),
    st.just("scene"),
    st.just("utf-8"),
)
PARTS = st.builds(_document, st.just(""), st.just(""), BODIES, st.just("scene"), st.just("utf-8"))


# ---------------------------------------------------------------------------------------------
# Archives
# ---------------------------------------------------------------------------------------------

ENTRY_NAMES = st.one_of(
    st.sampled_from(BAD_PATHS).map(str.encode),
    st.sampled_from(
        [
            *(b"SCENE.XML", b"Scene.xml", "é.ply".encode(), "e\u0301.ply".encode(), b"a.ply"),
            *(b"\x82.ply", b"\xff\xfe", b"\n\xff", b"\xed\xa0\x80", b"\xc0\xae\xc0\xae/x", b"\xe9"),
            *(b"a\0b", b"a.ply\0.xml", b"\0", b"tex", b"tex/", b"a.ply/", b"/", b"deep/er/", b"."),
            *(b"x.so", b"x.SO", b"x.dll", b"X.Dylib", b"tex/x.so", "ß.xml".encode(), b"SS.xml"),
            *("ſcene.xml".encode(), "İ.xml".encode(), "ﬁ.xml".encode(), "\u0345".encode()),
            *(b"/".join([b"d"] * 40), b"/".join([b"d" * 60] * 20), b"x" * 255, b"x" * 60_000),
            *(b"__MACOSX/x.xml", b"other/scene.xml", b".git/config", b"sitecustomize.py"),
        ]
    ),
    st.binary(max_size=8),
    st.text(max_size=8).map(lambda text: text.encode("utf-8", "replace")),
)
_MODES = [0, stat.S_IFREG, stat.S_IFDIR, stat.S_IFLNK, stat.S_IFCHR, stat.S_IFBLK, stat.S_IFIFO]
ATTRIBUTE_BITS = st.builds(
    lambda kind, mode, dos: (kind | mode) << 16 | dos,
    st.sampled_from([*_MODES, stat.S_IFSOCK, 0o170000]),
    st.sampled_from([0, 0o644, 0o6777]),
    st.sampled_from([0, 0x10]),
)
SIZES = st.sampled_from([0, 1, 10, 10**6, 2**31, 2**32 - 2, 2**32 - 1, 2**33, 2**63, 2**64 - 1])
SMALL = st.sampled_from([0, 1, 8, 9, 12, 14, 20, 45, 63, 64, 99, 0xFFFF])
FORGERIES = st.one_of(
    st.tuples(st.sampled_from(["packed", "unpacked", "offset"]), SIZES | st.integers(0, 2000)),
    st.tuples(st.just("crc"), st.sampled_from([0, 2**32 - 1])),
    st.tuples(st.sampled_from(["method", "version", "disk"]), SMALL),
    st.tuples(st.just("flags"), st.sampled_from([1, 0x8, 0x20, 0x40, UTF8_NAME, 0x2000, 0xFFFF])),
    st.tuples(st.just("name"), ENTRY_NAMES),
    st.tuples(st.sampled_from(["extra", "comment"]), st.binary(max_size=20)),
    st.tuples(
        st.just("extra"),
        st.sampled_from(
            [
                b"\x01\x00\x08\x00" + b"\xff" * 8,
                b"\x01\x00\xff\xff",
                b"\x75\x70\x09\x00\x01\0\0\0\0../x",  # a Unicode path
            ]
        ),
    ),
)
BOMB = bytes(2**21)
CONTENTS = st.sampled_from([b"", PLY, b"<scene", b"PK\3\4", BOMB]) | PARTS | st.binary(max_size=30)


@st.composite
def _entries(draw: st.DrawFn) -> list[Entry]:
    scene = draw(st.one_of(PLAIN_SCENES, PLAIN_SCENES, SCENES))
    good = {"scene.xml": scene, "a.ply": PLY, "tex/b.png": PNG, "é.ply": PLY}
    good |= {"part.xml": draw(PARTS), "deep/er/c.xml": b"<scene/>"}
    top = draw(st.sampled_from(["", "", "room/"]))
    entries = [Entry((top + name).encode(), content) for name, content in good.items()]
    for _ in range(draw(st.sampled_from([0, 0, 0, 1, 2]))):
        name = draw(ENTRY_NAMES)
        method = draw(st.sampled_from([DEFLATED, STORED]))
        attributes = draw(st.sampled_from([0, 0, stat.S_IFREG << 16]) | ATTRIBUTE_BITS)
        entries.append(Entry(name, draw(CONTENTS), method, attributes))
    for _ in range(draw(st.sampled_from([0, 0, 0, 1, 2]))):
        entry = draw(st.sampled_from(entries))
        forged = dict([draw(FORGERIES)])
        where = draw(st.sampled_from(["local", "central", "both"]))
        if where != "central":
            entry.local |= {name: value for name, value in forged.items() if name != "offset"}
        if where != "local":
            entry.central |= forged
    if draw(st.sampled_from([False] * 15 + [True])):  # one that unpacks from another's bytes
        entries.append(Entry(b"twin.bin", PLY, central={"offset": 0}, data=b""))
    if draw(st.sampled_from([False] * 15 + [True])):  # one more than once
        entries.append(draw(st.sampled_from(entries)))
    return entries


@st.composite
def _archives(draw: st.DrawFn) -> tuple[bytes, object]:
    entries = draw(_entries())
    ends = st.sampled_from(["disk", "here", "total", "size", "offset"])
    forged = draw(
        st.dictionaries(ends, SIZES | st.integers(0, 2000), max_size=1)
        if draw(st.sampled_from([False] * 9 + [True]))
        else st.just({})
    )
    whole = archive(
        entries,
        comment=draw(st.sampled_from([b""] * 20 + [b"PK\5\6" + bytes(18), bytes(65535)])),
        zip64=draw(st.sampled_from([False, False, False, True])),
        prefix=draw(st.sampled_from([b""] * 20 + [b"PK", b"<scene/>", b"#!/bin/sh\n"])),
        **forged,
    )
    return whole, [(entry.name[:80], entry.local, entry.central) for entry in entries]


# ---------------------------------------------------------------------------------------------
# Uploads
# ---------------------------------------------------------------------------------------------

ACTS = st.lists(
    st.tuples(st.sampled_from(VANDALISM), st.integers(0, 10**6), st.integers(0, 2**32 - 1)),
    min_size=1,
    max_size=3,
)
PARAMETERS = st.one_of(
    *[st.just({})] * 6,
    st.builds(lambda value: {"w": value}, NUMBERS),
    st.builds(lambda to: {"mesh": to}, PATHS),
    st.dictionaries(NAMES, TEXTS, max_size=2),
    st.sampled_from([{}] * 9 + [{f"p{n}": "1" for n in range(300)}]),
)


@st.composite
def uploads(draw: st.DrawFn) -> Upload:
    """One hostile upload: most are archives, and about a third are vandalised."""
    kind = draw(st.sampled_from(["archive"] * 14 + ["xml"] * 5 + ["bytes"]))
    story: object = kind
    if kind == "archive":
        content, story = draw(_archives())
    elif kind == "xml":
        content = draw(SCENES | PLAIN_SCENES)
        story = content[:300]
    else:
        content = draw(st.binary(max_size=100) | st.binary(max_size=60).map(b"PK".__add__))
    if draw(st.sampled_from([False, False, False, True])):
        acts = draw(ACTS)
        content = vandalise(content, acts)
        story = (story, [(act.__name__, place, value) for act, place, value in acts])
    return Upload(
        content,
        parameters=draw(PARAMETERS),
        sensor=draw(st.sampled_from([0] * 12 + [1, -1, 2**40])),
        story=story,
    )
