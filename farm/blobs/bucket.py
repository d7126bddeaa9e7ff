"""A blob store in S3.

Credentials are no setting of Plateau's: obstore reads them from the environment, under the names
that AWS gave them, and renews those that run out. Nothing here sees them.
"""

import os
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, Final
from urllib.parse import urlsplit

import obstore
from obstore.store import S3Store

from plateau.farm.blobs.errors import is_absence, is_silence

if TYPE_CHECKING:
    from obstore.store import BackoffConfig, ClientConfig

#: No request takes longer without a word from the store, be it the answer to a part of a blob.
_SILENCE_S: Final = 20.0
_CONNECT: Final = timedelta(seconds=5)
#: A blob of gigabytes comes by one request, which may take its time as long as bytes come.
_WHOLE: Final = timedelta(hours=6)
_TRIES_AGAIN: Final = 3
_BACKOFF: "Final[BackoffConfig]" = {
    "init_backoff": timedelta(milliseconds=100),
    "max_backoff": timedelta(seconds=2),
    "base": 2,
}
#: A larger blob goes up in parts of this size, so many at a time: 0.5 MB/s are enough.
_PART_BYTES: Final = 5 << 20
_PARTS_AT_A_TIME: Final = 2

#: In the order in which obstore heeds them.
_ENDPOINTS: Final = ("AWS_ENDPOINT_URL_S3", "AWS_ENDPOINT_URL", "AWS_ENDPOINT")


class Bucket:
    """The objects below a URL.

    Methods raise what obstore raises; `plateau.farm.blobs.store.Blobs` puts it in words.

    Parameters
    ----------
    url
        ``s3://BUCKET/PREFIX``; no prefix is one.

    Raises
    ------
    ValueError
        The URL is another one, or has what does not belong there, such as credentials.
    """

    #: What it means that a blob which was there for good is not there.
    lost = "{where} does not have what was stored there: is it still the bucket of this farm?"

    def __init__(self, url: str) -> None:
        parts = urlsplit(url)
        if "@" in parts.netloc:
            raise ValueError(
                "credentials do not belong in the URL: set AWS_ACCESS_KEY_ID and "
                "AWS_SECRET_ACCESS_KEY"
            )
        if parts.scheme != "s3" or not parts.netloc or parts.query or parts.fragment:
            raise ValueError(f"{url} is neither a folder nor of the form s3://BUCKET/PREFIX")
        silence = timedelta(seconds=_SILENCE_S)
        self._gate = _Gate()
        self.store = S3Store(
            parts.netloc,
            prefix=parts.path.strip("/") or None,
            client_options={
                "connect_timeout": _CONNECT,
                "read_timeout": silence,
                "timeout": _WHOLE,
                **_of_environment(),
            },
            # No try is begun after a silence, so that a call to a silent store ends with the first.
            retry_config={
                "max_retries": _TRIES_AGAIN,
                "retry_timeout": silence,
                "backoff": _BACKOFF,
            },
        )

    def put(self, name: str, content: bytes | BinaryIO) -> None:
        """Store a blob whole or not at all; a large one in parts."""
        obstore.put(
            self.store,
            name,
            content,
            chunk_size=_PART_BYTES,
            max_concurrency=_PARTS_AT_A_TIME,
        )

    def create(self, name: str, content: bytes) -> None:
        """As `put`, but raise `AlreadyExistsError` where there is a blob of this name.

        That may be this very one, where the answer to the first try was lost.
        """
        obstore.put(self.store, name, content, mode="create")

    def settle(self, name: str) -> None:
        """Do nothing: what a store has acknowledged is durable."""

    def open(self, name: str) -> "obstore.GetResult":
        """The blob, to be read; what it says first of all may have to be waited for."""
        with self._gate.asking():
            return obstore.get(self.store, name)

    def size(self, name: str) -> int:
        """The blob's number of bytes."""
        with self._gate.asking():
            return obstore.head(self.store, name)["size"]

    def has(self, name: str) -> bool:
        """Whether there is a blob of this name, which is a small one.

        Asked by a GET: the answer to a HEAD has no words, and 404 may be said for other reasons.
        """
        try:
            self.open(name).bytes()
        except FileNotFoundError as error:
            if is_absence(error):
                return False
            raise
        return True

    def delete(self, names: Iterable[str]) -> None:
        """Remove blobs, a thousand by a request; one that is not there is fine."""
        obstore.delete(self.store, list(names))

    def leftovers(self, older_than_s: float) -> list[Path]:
        """Nothing: a store never shows half a blob, and its own rules say how long it keeps one."""
        del older_than_s
        return []


def _of_environment() -> "ClientConfig":
    """What obstore wants to be told of the environment, beyond what it reads there itself."""
    options: ClientConfig = {}
    endpoint = next((os.environ[name] for name in _ENDPOINTS if os.environ.get(name)), "")
    if endpoint.startswith("http://"):
        options["allow_http"] = True
    bundle = os.environ.get("AWS_CA_BUNDLE")
    if bundle:
        options["root_certificate"] = Path(bundle).read_bytes()
    return options


class _Gate:
    """Around small requests: while a store is silent, one caller at a time asks it.

    The others are told at once. Without it every thread of an API that is asked for pictures would
    soon wait for the store, and none would be left for what needs no blob.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._is_silent = False
        self._is_asked = False

    @contextmanager
    def asking(self) -> Iterator[None]:
        """Let the caller ask, or raise `TimeoutError` where another does, and it was silent."""
        with self._lock:
            asks_for_all = self._is_silent
            if asks_for_all and self._is_asked:
                raise TimeoutError("it did not answer a moment ago")
            self._is_asked = asks_for_all
        is_silent = False
        try:
            yield
        except Exception as error:
            is_silent = is_silence(error)
            raise
        finally:
            with self._lock:
                self._is_silent = is_silent
                if asks_for_all:
                    self._is_asked = False
