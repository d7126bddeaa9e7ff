"""Hostile uploads, as Hypothesis draws them: scenes, archives of scenes, and wrecks of both."""

import stat
import zipfile
from dataclasses import dataclass, field
from xml.sax.saxutils import quoteattr

from hypothesis import strategies as st

from tests.support.scenes.bundles import PLY, PNG, link, zipped

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


# Values

FILES = ["scene.xml", "part.xml", "a.ply", "tex/b.png", "deep/er/c.xml", "é.ply"]
GOOD_PATHS = [*FILES, "./a.ply", "tex/../a.ply", "deep/er/../../a.ply", "tex//b.png", "tex", "deep"]
BAD_PATHS = [
    *(CANARY, "/etc/passwd", "//host/share", "/", "/./a.ply", "/proc/self/environ"),
    *("..", "../a.ply", "../../../../../../etc/passwd", "tex/../../a.ply", "a.ply/../../x"),
    *("C:\\x", "C:/x", "\\\\host\\share\\x", "..\\x", "tex\\..\\..\\x", "\\\\?\\C:\\x"),
    *("~/x", "$HOME/x", "${HOME}", "%2e%2e/x", "....//x", "file:///etc/passwd", "|id", "`id`"),
    *("", " ", ".", "no.ply", "a.ply/", "a.ply/x", "A.PLY", "e\u0301.ply", "a.ply "),
    *("．．/x", "‥/x", "..∕x", "a\u202eylp.a", "\ufeffa.ply", "a.ply\u200b", "ａ.ply"),
    *("x" * 300, "x" * 5000, "./" * 2100 + "a.ply", "../" * 50 + "x", "tex/../" * 300 + "a.ply"),
    *("nul.ply", "a.ply.", "*", "a;b", "a\nb", "a\tb"),
]
PATHS = st.sampled_from(GOOD_PATHS) | st.sampled_from(BAD_PATHS)
NUMBERS = st.sampled_from(
    [
        *("1", "7", "64", "0", "-1", "1000000", "67108864", "67108865", "4294967296", "9" * 40),
        *("0" * 25 + "1000000", "-" + "0" * 30, "9" * 4000, "nan", "inf", "1e999", "2.5", "+5"),
        *("0x10", "1_0", "١", "½", "", " 5 ", "\t5\n", "5\x85", "--5", "1,000", "true", "$w"),
    ]
)
NAMES = st.sampled_from(
    [
        *("filename", "width", "height", "crop_width", "crop_height", "crop_offset_x", "cropWidth"),
        *("to_world", "w", "mesh", "", "x" * 200, "FileName", "é", "path", "a\nb", "$w", "id"),
    ]
)
TEXTS = st.one_of(
    PATHS,
    NUMBERS,
    st.sampled_from(["$w", "$mesh", "\\$w", "$", "$$", "$wx", "x" * 70_000, "$w" * 40_000]),
    st.text(st.characters(codec="utf-8", exclude_categories=("Cs", "Cc")), max_size=12),
)
TYPES = st.sampled_from(
    [
        *("perspective", "hdrfilm", "ply", "sphere", "path", "bitmap", "nosuch", ""),
        *("../x", "/tmp/x", "x.so", "é", "ply\n", "$w", "x" * 300),
    ]
)
TAGS = st.sampled_from(
    [
        *("sensor", "film", "shape", "bsdf", "texture", "emitter", "integrator", "scene", "string"),
        *(
            "integer",
            "float",
            "default",
            "include",
            "path",
            "ref",
            "alias",
            "spectrum",
            "transform",
        ),
        *("rfilter", "nosuchtag", "é", "a" * 200),
    ]
)
ATTRIBUTES = st.sampled_from(["name", "value", "type", "id", "filename", "version", "as", "xmlns"])


# XML


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
    st.builds(lambda name, to: _named("string", name, to), NAMES, PATHS),
)
FILM_SIZES = st.lists(
    st.builds(_named, st.sampled_from(["integer", "integer", "float", "ref"]), NAMES, NUMBERS),
    max_size=3,
).map("".join)
SENSORS = st.builds(
    lambda sizes, of: _element("sensor", {"type": "perspective"}, _element("film", of, sizes)),
    FILM_SIZES,
    st.sampled_from([{"type": "hdrfilm"}, {"type": "hdrfilm", "id": "f"}, {}]),
)
DEFAULTS = st.builds(
    lambda name, value: _named("default", name, value),
    st.sampled_from(["w", "mesh", "wx", ""]) | NAMES,
    TEXTS,
)
EXTREMES = st.sampled_from(
    [
        *("<a>" * 70 + "</a>" * 70, "<a>" * 5000, f'<string name="x" value="{"y" * 1_100_000}"/>'),
        *("<!--" + "x" * 100_000 + "-->", "<![CDATA[" + "]]" * 1000 + "]]>", "<?php x?>"),
        *('<a b="&x;"/>', '<a b="&#0;"/>', '<a b="&#xFFFF;&#x10FFFF;&#10;"/>', "<a b=1/>"),
        *("</scene>", "<scene>", "\0", "\ufffe"),
        "".join(f'<default name="p{n}" value=""/>' for n in range(300)),
        '<default name="p0" value="ha"/>'
        + "".join(f'<default name="p{n + 1}" value="$p{n}$p{n}"/>' for n in range(30)),
        "".join(_element("include", {"filename": "part.xml"}) for _ in range(30)),
    ]
)
BODIES = st.lists(
    st.one_of(REFERENCES, REFERENCES, ANY_ELEMENT, SENSORS, DEFAULTS, EXTREMES), max_size=5
).map("".join)
DECLARATIONS = st.sampled_from(
    [
        *("", "", "", '<?xml version="1.0"?>', "\n \n", '<?xml version="1.1"?>', "<?xml?>"),
        *('<?xml version="1.0" encoding="latin-1"?>', '<?xml version="1.0" encoding="utf-7"?>'),
        '<!DOCTYPE scene [<!ENTITY x SYSTEM "file:///etc/passwd">]>',
        '<!DOCTYPE a [<!ENTITY % p SYSTEM "http://127.0.0.1/x"> %p;]>',
    ]
)
ENCODINGS = st.sampled_from(["utf-8"] * 6 + ["utf-8-sig", "utf-16", "utf-16-be", "utf-32", "cp037"])


def _document(declaration: str, sensor: str, body: str, root: str, encoding: str) -> bytes:
    text = f'{declaration}<{root} version="3.0.0">{sensor}{body}</{root}>'
    return text.encode(encoding, "replace")


_NONE, _SCENE, _UTF8 = st.just(""), st.just("scene"), st.just("utf-8")
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
    _NONE,
    st.just('<default name="w" value="8"/><sensor type="perspective"/>') | SENSORS,
    st.lists(REFERENCES, max_size=2).map("".join),
    _SCENE,
    _UTF8,
)
PARTS = st.builds(_document, _NONE, _NONE, BODIES, _SCENE, _UTF8)


# Archives

ENTRY_NAMES = st.one_of(
    st.sampled_from(BAD_PATHS),
    st.sampled_from(
        [
            *("SCENE.XML", "Scene.xml", "a.ply", "a\0b", "a.ply\0.xml", "tex", "tex/", "a.ply/"),
            *("x.so", "X.Dylib", "tex/x.dll", "ß.xml", "SS.xml", "ſcene.xml", "ﬁ.xml", "\u0345"),
            *("/".join(["d"] * 40), "/".join(["d" * 60] * 20), "x" * 255, "x" * 60_000),
            *("__MACOSX/x.xml", "other/scene.xml", ".git/config"),
        ]
    ),
    st.text(st.characters(codec="utf-8"), max_size=8),
)
KINDS = st.sampled_from([stat.S_IFREG] * 9 + [stat.S_IFLNK, stat.S_IFDIR, stat.S_IFCHR, 0o170000])
SIZES = st.sampled_from([0, 1, 10, 10**6, 2**31, 2**32 - 2, 2**32 - 1]) | st.integers(0, 2000)
FORGERIES = st.one_of(
    st.tuples(st.sampled_from(["compress_size", "file_size", "header_offset", "CRC"]), SIZES),
    st.tuples(st.just("compress_type"), st.sampled_from([0, 1, 9, 12, 14, 99])),
    st.tuples(st.just("flag_bits"), st.sampled_from([1, 0x8, 0x20, 0x40, 0x800, 0x2000, 0xFFFF])),
    st.tuples(st.just("filename"), ENTRY_NAMES),
    st.tuples(st.just("extra"), st.sampled_from([b"\1\0\x08\0" + b"\xff" * 8, b"\1\0\xff\xff"])),
)
CONTENTS = st.sampled_from([b"", PLY, b"<scene", b"PK\3\4", bytes(2**21)]) | PARTS


@st.composite
def _archives(draw: st.DrawFn) -> tuple[bytes, object]:
    scene = draw(st.one_of(PLAIN_SCENES, PLAIN_SCENES, SCENES))
    good = {"scene.xml": scene, "a.ply": PLY, "tex/b.png": PNG, "é.ply": PLY}
    good |= {"part.xml": draw(PARTS), "deep/er/c.xml": b"<scene/>"}
    top = draw(st.sampled_from(["", "", "room/"]))
    entries = [(zipfile.ZipInfo(top + name), content) for name, content in good.items()]
    odd = st.tuples(st.builds(link, ENTRY_NAMES, KINDS), CONTENTS)
    entries += draw(st.lists(odd, max_size=2)) if draw(st.booleans()) else []
    forgeries = draw(st.lists(st.tuples(st.integers(0, 7), FORGERIES), max_size=2))
    if draw(st.booleans()):
        forgeries = []

    def forge(directory: list[zipfile.ZipInfo]) -> None:
        for place, (name, value) in forgeries:
            setattr(directory[place % len(directory)], name, value)

    return zipped(entries, forge=forge).getvalue(), [
        [info.filename for info, _ in entries],
        forgeries,
    ]


# Uploads

_SIGNATURES = (b"PK\1\2", b"PK\3\4", b"PK\5\6", b"PK\6\6", b"PK\6\7")


@st.composite
def _vandalised(draw: st.DrawFn, content: bytes) -> bytes:
    """The content with other bytes somewhere, or fewer, or some of them twice."""
    for _ in range(draw(st.integers(1, 3))):
        # Near its end an archive keeps its directory
        at = draw(
            st.integers(0, len(content)) | st.integers(max(0, len(content) - 200), len(content))
        )
        left = at + draw(st.sampled_from([0, 1, 4, 40]))
        put = draw(st.binary(max_size=4) | st.sampled_from([*_SIGNATURES, content[:80]]))
        content = content[:at] + put + (content[left:] if draw(st.integers(0, 4)) else b"")
    return content


PARAMETERS = st.one_of(
    *[st.just({})] * 6,
    st.builds(lambda value: {"w": value}, NUMBERS),
    st.builds(lambda to: {"mesh": to}, PATHS),
    st.dictionaries(NAMES, TEXTS, max_size=2),
)


@st.composite
def uploads(draw: st.DrawFn) -> Upload:
    """One hostile upload: most are archives, and about a quarter are vandalised."""
    kind = draw(st.sampled_from(["archive"] * 14 + ["xml"] * 5 + ["bytes"]))
    story: object = kind
    if kind == "archive":
        content, story = draw(_archives())
    elif kind == "xml":
        content = draw(SCENES | PLAIN_SCENES)
    else:
        content = draw(st.binary(max_size=100) | st.binary(max_size=60).map(b"PK".__add__))
    if draw(st.sampled_from([False, False, False, True])):
        content = draw(_vandalised(content))
    return Upload(
        content,
        parameters=draw(PARAMETERS),
        sensor=draw(st.sampled_from([0] * 12 + [1, -1, 2**40])),
        story=story,
    )
