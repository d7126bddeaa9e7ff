"""What a file is that should be another, by its first bytes."""

import zlib
from typing import Final

GZIP: Final = b"\x1f\x8b"
ZSTANDARD: Final = b"\x28\xb5\x2f\xfd"
#: The bytes that `what_it_is` needs.
BEGINNING_BYTES: Final = 1024

_ARCHIVE: Final = "{}; unpack it, and send the scene, or a zip of it"
#: Where the bytes stand, and what a file with them is.
_MAGIC: Final = (
    (0, ZSTANDARD, _ARCHIVE.format("a Zstandard file")),
    (0, b"Rar!\x1a\x07", _ARCHIVE.format("a RAR archive")),
    (0, b"7z\xbc\xaf\x27\x1c", _ARCHIVE.format("a 7z archive")),
    (0, b"\xfd7zXZ\0", _ARCHIVE.format("an xz file")),
    (0, b"BZh", _ARCHIVE.format("a bzip2 file")),
    (257, b"ustar", _ARCHIVE.format("a tar archive")),
    (0, b"PK\3\4", "a zip archive"),
    (0, b"%PDF", "a PDF"),
    (
        0,
        b"version https://git-lfs",
        "a pointer of Git LFS; fetch the file itself by `git lfs pull`",
    ),
    (8, b"WEBP", "a WebP image"),
    (0, b"II*\0", "a TIFF image"),
    (0, b"MM\0*", "a TIFF image"),
    (0, b"GIF8", "a GIF image"),
    (4, b"ftypavif", "an AVIF image"),
    (4, b"ftyphei", "a HEIF image"),
    (4, b"ftyp", "a video"),
    (0, b"8BPS", "a Photoshop file"),
    (0, b"DDS ", "a DDS texture"),
    (1, b"KTX", "a KTX texture"),
    (0, b"\0\0\0\x0cjP", "a JPEG 2000 image"),
    (0, b"\x89PNG", "a PNG image"),
    (0, b"\xff\xd8\xff", "a JPEG image"),
    (0, b"\x76\x2f\x31\x01", "an OpenEXR image"),
    (0, b"ply\n", "a PLY mesh"),
    (0, b"ply\r", "a PLY mesh"),
    (0, b"PXR-USDC", "a USD file"),
    (0, b"#usda", "a USD file"),
    (0, b"glTF", "a glTF file"),
    (0, b"Kaydara FBX", "an FBX file"),
)


def what_it_is(beginning: bytes) -> str | None:
    """Return what a file is that begins so, with what to do; None for what is not known."""
    if beginning.startswith(GZIP):
        inner = gunzipped(beginning)
        what = (
            "a Mitsuba XML" if inner.startswith(b"<") else (inner and what_it_is(inner)) or "a file"
        )
        return f"{what.partition(';')[0]} compressed by gzip; unpack it first"
    text = beginning.removeprefix(b"\xef\xbb\xbf").lstrip().lower()
    if text.startswith(b"<") and (b"<html" in text or text.startswith(b"<!doctype html")):
        return "a web page, perhaps the error of a download; download it again"
    found = (what for at, magic, what in _MAGIC if beginning[at:].startswith(magic))
    return next(found, None) or (None if beginning else "empty")


def gunzipped(beginning: bytes) -> bytes:
    """Return the first bytes of what begins so, compressed by gzip."""
    try:
        return zlib.decompressobj(wbits=31).decompress(beginning, BEGINNING_BYTES)
    except zlib.error:
        return b""
