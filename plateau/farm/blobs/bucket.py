"""A blob store in S3, and one that a process of another machine serves.

Plateau has no setting for credentials and never sees them: obstore reads them from AWS's
environment variables, and renews those that expire.
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
from obstore.store import HTTPStore, S3Store

from plateau.farm.blobs.errors import is_absence, is_silence

if TYPE_CHECKING:
    from obstore.store import ClientConfig, RetryConfig

#: A request fails once the store has sent nothing for this long.
_SILENCE: Final = timedelta(seconds=20)
_SENDING: Final = timedelta(minutes=30)
TIMES: "Final[ClientConfig]" = {
    "connect_timeout": timedelta(seconds=5),
    "read_timeout": _SILENCE,
    # One request reads a blob of gigabytes; it may take long as long as bytes arrive.
    "timeout": timedelta(hours=6),
}
#: No retry starts after a silence: a call to a silent store fails at its first try.
RETRIES: "Final[RetryConfig]" = {
    "max_retries": 3,
    "retry_timeout": _SILENCE,
    "backoff": {
        "init_backoff": timedelta(milliseconds=100),
        "max_backoff": timedelta(seconds=2),
        "base": 2,
    },
}
#: A larger blob is uploaded in parts of this size, two at a time: 0.5 MB/s are enough.
_PART_BYTES: Final = 5 << 20
_PARTS_AT_A_TIME: Final = 2

#: In obstore's order of precedence.
_ENDPOINTS: Final = ("AWS_ENDPOINT_URL_S3", "AWS_ENDPOINT_URL", "AWS_ENDPOINT")


class Bucket:
    """The objects below a URL.

    Methods raise obstore's errors; `plateau.farm.blobs.store.Blobs` explains them.
    """

    #: There is no folder for half-written blobs.
    scratch = None
    #: The message where the store has lost its mark.
    lost = "{where} does not have what was stored there: is it still the bucket of this farm?"

    def __init__(self, url: str) -> None:
        """Open ``s3://BUCKET`` or ``s3://BUCKET/PREFIX``; `ValueError` for any other URL."""
        parts = urlsplit(url)
        if "@" in parts.netloc:
            raise ValueError(
                "credentials do not belong in the URL: set AWS_ACCESS_KEY_ID and "
                "AWS_SECRET_ACCESS_KEY"
            )
        if parts.scheme != "s3" or not parts.netloc or parts.query or parts.fragment:
            raise ValueError(f"{url} is neither a folder nor of the form s3://BUCKET/PREFIX")
        self._gate = Gate()
        self.store: S3Store | HTTPStore = S3Store(
            parts.netloc,
            prefix=parts.path.strip("/") or None,
            client_options={**TIMES, **_of_environment()},
            retry_config=RETRIES,
        )

    def put(self, name: str, content: bytes | BinaryIO) -> None:
        """Store a blob whole or not at all; a large one in parts."""
        obstore.put(
            self.store, name, content, chunk_size=_PART_BYTES, max_concurrency=_PARTS_AT_A_TIME
        )

    def create(self, name: str, content: bytes) -> None:
        """As `put`, but raise `AlreadyExistsError` where a blob has this name.

        That blob may be this one: an earlier try stored it and its answer was lost.
        """
        obstore.put(self.store, name, content, mode="create")

    def settle(self, name: str) -> None:
        """Do nothing: a store acknowledges only durable blobs."""

    def read(self, name: str) -> bytes:
        """The blob's bytes."""
        return bytes(self.open(name).bytes())

    def open(self, name: str) -> "obstore.GetResult":
        """The blob, to be read; this waits for the first bytes of the answer."""
        with self._gate.asking():
            return obstore.get(self.store, name)

    def size(self, name: str) -> int:
        """The blob's number of bytes."""
        with self._gate.asking():
            return obstore.head(self.store, name)["size"]

    def has(self, name: str) -> bool:
        """Whether a small blob has this name.

        By a GET: the answer to a HEAD has no body, and a 404 may have other reasons.
        """
        try:
            self.open(name).bytes()
        except FileNotFoundError as error:
            if is_absence(error):
                return False
            raise
        return True

    def delete(self, names: Iterable[str]) -> None:
        """Remove blobs, a thousand in a request; a missing blob is fine."""
        obstore.delete(self.store, list(names))

    def leftovers(self, older_than_s: float) -> list[Path]:
        """Nothing: a store never lists half a blob, and removes it by its own rules."""
        del older_than_s
        return []


def _of_environment() -> "ClientConfig":
    """The options for environment variables that obstore does not read itself."""
    options: ClientConfig = {}
    endpoint = next((os.environ[name] for name in _ENDPOINTS if os.environ.get(name)), "")
    if endpoint.startswith("http://"):
        options["allow_http"] = True
    if bundle := os.environ.get("AWS_CA_BUNDLE"):
        options["root_certificate"] = Path(bundle).read_bytes()
    return options


class Gate:
    """Around small requests: one caller at a time asks a silent store, the others fail at once.

    Otherwise requests for pictures would soon hold every thread of the API.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._is_silent = False
        self._is_asked = False

    @contextmanager
    def asking(self) -> Iterator[None]:
        """Let the caller ask; `TimeoutError` where the store was silent and another asks it."""
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


class Served(Bucket):
    """The blobs behind ``http://SECRET@HOST:PORT``, for as long as the run lasts that serves them.

    `plateau.engines.blob_server` is the other end. Nothing is created here: its own process has
    made the mark before it serves.
    """

    lost = "the run whose blobs were served there is over"

    def __init__(self, url: str) -> None:
        parts = urlsplit(url)
        self._gate = Gate()
        where = f"http://{parts.hostname}:{parts.port}"
        options: ClientConfig = {
            **TIMES,
            "allow_http": True,
            "default_headers": {"authorization": f"Bearer {parts.username}"},
        }
        self.store = HTTPStore(where, client_options=options, retry_config=RETRIES)
        # The client's silence lasts while it sends, and a film goes in one request.
        slow: ClientConfig = {**options, "read_timeout": _SENDING}
        self._puts = HTTPStore(where, client_options=slow, retry_config=RETRIES)

    def put(self, name: str, content: bytes | BinaryIO) -> None:
        """Store a blob whole or not at all."""
        obstore.put(self._puts, name, content, use_multipart=False)
