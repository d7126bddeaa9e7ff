"""Whether a file has come whole: by the digest that the service sends with it."""

import base64
import hashlib
from collections.abc import Mapping
from typing import Final

from plateau.client.errors import Damaged

#: RFC 9530, section 3: ``sha-256=:BASE64:``, perhaps among others.
_HEADER: Final = "Repr-Digest"
_SHA256: Final = "sha-256"


class Digest:
    """The SHA-256 of what comes of a file."""

    def __init__(self) -> None:
        self._sha256 = hashlib.sha256()

    def update(self, chunk: bytes) -> None:
        """Take up the next bytes."""
        self._sha256.update(chunk)

    def check(self, path: str, headers: Mapping[str, str]) -> None:
        """Raise `Damaged` where the headers name another one than that of all that came."""
        digests = (one.strip().partition("=") for one in headers.get(_HEADER, "").split(","))
        named = next((value for name, _, value in digests if name == _SHA256), None)
        found = base64.b64encode(self._sha256.digest()).decode()
        if named is not None and named != f":{found}:":
            raise Damaged(path)
