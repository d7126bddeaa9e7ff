"""Serves a folder of blobs to the nodes of one run, over HTTP and by a secret.

So nodes need no disk in common with the command's machine.
"""

import hmac
import secrets
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from itertools import chain
from threading import Thread
from typing import Final
from urllib.parse import unquote

from plateau.farm.blobs.store import Blobs
from plateau.farm.model.errors import BlobsUnavailable

#: A node that has sent nothing for this long has gone.
_SILENCE_S: Final = 60.0


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    request_queue_size = 256

    def __init__(self, blobs: Blobs, secret: str) -> None:
        super().__init__(("", 0), _Request)
        self.blobs, self.expected = blobs, f"Bearer {secret}"

    def handle_error(self, request: object, client_address: object) -> None:
        """Say nothing: a node that goes in the middle of a request sends it again, or is gone."""


class _Request(BaseHTTPRequestHandler):
    """GET, HEAD, PUT and DELETE of one blob, as `plateau.farm.blobs.bucket` asks for them."""

    protocol_version = "HTTP/1.1"
    timeout = _SILENCE_S
    server: _Server

    def do_GET(self) -> None:
        """Answer one request; what it stores is on the disk when the answer goes out."""
        given = self.headers.get("Authorization", "")
        if not hmac.compare_digest(given.encode(), self.server.expected.encode()):
            self.close_connection = True  # what it wanted to send stays unread
            self._send(403)
            return
        try:
            size, chunks = self._done(unquote(self.path[1:]), self.server.blobs)
        except (FileNotFoundError, ValueError):  # the latter: this is no name of a blob
            self._send(404)
        except BlobsUnavailable as error:  # the disk is full
            why = str(error).encode()
            self._send(507, len(why), [why])
        else:
            self._send(200, size, chunks)

    do_HEAD = do_PUT = do_DELETE = do_GET  # noqa: N815

    def _done(self, name: str, blobs: Blobs) -> tuple[int, Iterable[bytes]]:
        """Do what is asked; returns the length of the answer's body, and its parts if it has any.

        So a scene of gigabytes that many nodes fetch at once is in no memory.
        """
        if self.command == "PUT":
            length = int(self.headers["Content-Length"])
            content = self.rfile.read(length)
            if len(content) < length:  # who sent it has gone, or sends it again
                raise ConnectionResetError
            blobs.put(name, content)
            return 0, ()
        if self.command == "DELETE":
            blobs.delete(name)
            return 0, ()
        size = blobs.size(name)
        if size is None:
            raise FileNotFoundError
        if self.command == "HEAD":
            return size, ()
        chunks = blobs.chunks(name)
        return size, chain([next(chunks, b"")], chunks)  # once it is open, it may be deleted

    def _send(self, status: int, size: int = 0, body: Iterable[bytes] = ()) -> None:
        self.send_response(status)
        self.send_header("Content-Length", str(size))
        self.send_header("Last-Modified", self.date_time_string())  # the client wants one
        self.send_header("ETag", '"blob"')  # and this: a blob never changes
        self.end_headers()
        for chunk in () if self.command == "HEAD" else body:
            self.wfile.write(chunk)

    def log_message(self, *_: object) -> None:
        """Log nothing: the nodes log what fails."""


@contextmanager
def serving(blobs: Blobs, secret: str) -> Iterator[int]:
    """Serve these blobs on every address of this machine while the context lasts; gives the port.

    Whoever sends another secret gets 403, and learns no name.
    """
    server = _Server(blobs, secret)
    Thread(target=server.serve_forever, name="blobs", daemon=True).start()
    try:
        yield server.server_address[1]
    finally:
        server.expected = secrets.token_hex()  # for connections that are still open
        server.shutdown()
        server.server_close()
