"""A blob store that a process of another machine serves for as long as its run lasts.

`plateau.engines.blob_server` is the other end.
"""

from typing import BinaryIO
from urllib.parse import urlsplit

import obstore
from obstore.store import HTTPStore

from plateau.farm.blobs.bucket import RETRIES, TIMES, Bucket, Gate


class Served(Bucket):
    """The blobs behind ``http://SECRET@HOST:PORT``.

    Nothing is created here: its own process has made the mark before it serves.
    """

    lost = "the run whose blobs were served there is over"

    def __init__(self, url: str) -> None:
        parts = urlsplit(url)
        self._gate = Gate()
        self.store = HTTPStore(
            f"http://{parts.hostname}:{parts.port}",
            client_options={
                **TIMES,
                "allow_http": True,
                "default_headers": {"authorization": f"Bearer {parts.username}"},
            },
            retry_config=RETRIES,
        )

    def put(self, name: str, content: bytes | BinaryIO) -> None:
        """Store a blob whole or not at all."""
        obstore.put(self.store, name, content, use_multipart=False)
