"""Archives written byte by byte, so that any field may lie, and what a vandal does to them.

`zipfile` writes only what is right. Here an archive is a list of entries, and each field of an
entry's local header and of its record in the directory can be given a value of its own.
"""

import struct
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

STORED, DEFLATED = 0, 8
UTF8_NAME = 0x800
UNIX = 3

_LOCAL = struct.Struct("<4s5H3L2H")
_CENTRAL = struct.Struct("<4s6H3L5H2L")
_END = struct.Struct("<4s4H2LH")
_END_64 = struct.Struct("<4sQ2H2L4Q")
_LOCATOR_64 = struct.Struct("<4sLQL")
_DATE = 0x21  # 1 January 1980


@dataclass
class Entry:
    """One entry, true unless `local` or `central` forge a field of its two headers.

    The fields: version, flags, method, crc, packed, unpacked, name, extra; and in the directory
    comment, disk, attributes, offset too.
    """

    name: bytes
    content: bytes = b""
    method: int = DEFLATED
    attributes: int = 0  #: external; a Unix mode is in the upper 16 bits
    local: dict[str, Any] = field(default_factory=dict)
    central: dict[str, Any] = field(default_factory=dict)
    #: what is written in the place of its data, packed as `method` says
    data: bytes | None = None

    def truth(self) -> dict[str, Any]:
        deflater = zlib.compressobj(9, zlib.DEFLATED, -15)
        packed = (
            deflater.compress(self.content) + deflater.flush()
            if self.method == DEFLATED
            else self.content
        )
        data = packed if self.data is None else self.data
        return {
            "version": 20,
            "flags": 0 if self.name.isascii() else UTF8_NAME,
            "method": self.method,
            "crc": zlib.crc32(self.content),
            "packed": len(data),
            "unpacked": len(self.content),
            "name": self.name,
            "extra": b"",
            "comment": b"",
            "disk": 0,
            "attributes": self.attributes,
            "data": data,
        }


def archive(
    entries: Sequence[Entry],
    *,
    comment: bytes = b"",
    zip64: bool = False,
    prefix: bytes = b"",
    **forged_end: int,
) -> bytes:
    """The bytes of an archive. `forged_end`: disk, here, total, size and offset of its directory.

    With `prefix`, offsets are wrong by its length unless the entries forge them.
    """
    body, directory = bytearray(), bytearray()
    for entry in entries:
        truth = {**entry.truth(), "offset": len(body)}
        body += _local(truth | entry.local)
        directory += _central(truth | entry.central)
    end = {"disk": 0, "here": len(entries), "total": len(entries)}
    end |= {"size": len(directory), "offset": len(body)} | forged_end
    tail = b""
    if zip64:
        head = (_END_64.size - 12, 45, 45, 0, end["disk"] & 0xFFFFFFFF)
        numbers = (end["here"], end["total"], end["size"], end["offset"])
        tail = _END_64.pack(b"PK\6\6", *head, *numbers)
        tail += _LOCATOR_64.pack(b"PK\6\7", 0, len(body) + len(directory), 1)
        end |= {"here": 0xFFFF, "total": 0xFFFF, "size": 2**32 - 1, "offset": 2**32 - 1}
    tail += _END.pack(
        b"PK\5\6",
        end["disk"] & 0xFFFF,
        end["disk"] & 0xFFFF,
        end["here"] & 0xFFFF,
        end["total"] & 0xFFFF,
        end["size"] & 0xFFFFFFFF,
        end["offset"] & 0xFFFFFFFF,
        len(comment),
    )
    return bytes(prefix + body + directory + tail + comment)


def _local(of: dict[str, Any]) -> bytes:
    sizes = (of["crc"], of["packed"] & 0xFFFFFFFF, of["unpacked"] & 0xFFFFFFFF)
    names = (len(of["name"]) & 0xFFFF, len(of["extra"]) & 0xFFFF)
    head = (of["version"], of["flags"], of["method"], 0, _DATE)
    return bytes(_LOCAL.pack(b"PK\3\4", *head, *sizes, *names)) + (
        of["name"] + of["extra"] + of["data"]
    )


def _central(of: dict[str, Any]) -> bytes:
    # The 64-bit extra field holds, in this order, whatever does not fit its place.
    wide = [of[name] for name in ("unpacked", "packed", "offset") if of[name] >= 2**32 - 1]
    extra = of["extra"]
    if wide:
        extra += struct.pack(f"<2H{len(wide)}Q", 1, 8 * len(wide), *wide)
    small = {name: min(of[name], 2**32 - 1) for name in ("unpacked", "packed", "offset")}
    head = (20 | UNIX << 8, of["version"], of["flags"], of["method"], 0, _DATE, of["crc"])
    lengths = (len(of["name"]) & 0xFFFF, len(extra) & 0xFFFF, len(of["comment"]) & 0xFFFF)
    places = (of["disk"], 0, of["attributes"], small["offset"])
    return (
        _CENTRAL.pack(b"PK\1\2", *head, small["packed"], small["unpacked"], *lengths, *places)
        + of["name"]
        + extra
        + of["comment"]
    )


# ---------------------------------------------------------------------------------------------
# What may befall the bytes of any file: each takes them, a place and a value
# ---------------------------------------------------------------------------------------------

Vandalism = Callable[[bytes, int, int], bytes]
_SIGNATURES = (b"PK\1\2", b"PK\3\4", b"PK\5\6", b"PK\6\6", b"PK\6\7")


def set_byte(content: bytes, place: int, value: int) -> bytes:
    at = place % len(content)
    return content[:at] + bytes([value & 0xFF]) + content[at + 1 :]


def set_word(content: bytes, place: int, value: int) -> bytes:
    at = place % len(content)
    return content[:at] + (value & 0xFFFFFFFF).to_bytes(4, "little") + content[at + 4 :]


def set_byte_from_end(content: bytes, place: int, value: int) -> bytes:
    """Near its end an archive keeps its directory."""
    return set_byte(content, -1 - place % min(len(content), 200), value)


def truncate(content: bytes, place: int, value: int) -> bytes:
    return content[: 1 + place % len(content)]


def cut(content: bytes, place: int, value: int) -> bytes:
    at = place % len(content)
    return content[:at] + content[at + value % 64 :]


def splice(content: bytes, place: int, value: int) -> bytes:
    """A piece of it, once more, somewhere else."""
    at, source = place % len(content), value % len(content)
    return content[:at] + content[source : source + 80] + content[at:]


def repeat(content: bytes, place: int, value: int) -> bytes:
    return content * (2 + value % 3)


def plant_signature(content: bytes, place: int, value: int) -> bytes:
    at = place % len(content)
    return content[:at] + _SIGNATURES[value % len(_SIGNATURES)] + content[at + 4 :]


def append(content: bytes, place: int, value: int) -> bytes:
    return content + bytes([value & 0xFF]) * (place % 70_000)


def prepend(content: bytes, place: int, value: int) -> bytes:
    return bytes([value & 0xFF]) * (place % 300) + content


VANDALISM: tuple[Vandalism, ...] = (
    *(set_byte, set_word, set_byte_from_end, truncate, cut),
    *(splice, repeat, plant_signature, append, prepend),
)


def vandalise(content: bytes, acts: Sequence[tuple[Vandalism, int, int]]) -> bytes:
    """The content after each act in turn, as long as any is left."""
    for act, place, value in acts:
        if content:
            content = act(content, place, value)
    return content
