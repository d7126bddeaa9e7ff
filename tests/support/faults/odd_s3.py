"""An S3 server that is odd in one way at a time: what a farm meets beside those that work.

It keeps objects in memory, lists none and checks no signature. What S3 must do is held against real
servers, in tests/cluster.
"""

import re
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer


def error(status: int, code: str) -> tuple[int, bytes]:
    """An error as S3 gives it."""
    return status, f"<Error><Code>{code}</Code><Message>No.</Message></Error>".encode()


class OddS3:
    """Serves while the context lasts.

    Attributes
    ----------
    says
        What it answers to every request instead of doing it: status and body.
    silent
        While this is set, it answers nothing.
    """

    def __init__(self) -> None:
        self.objects: dict[str, bytes] = {}
        self.says: tuple[int, bytes] | None = None
        self.silent = threading.Event()
        self._over = threading.Event()
        self._server = ThreadingHTTPServer(("127.0.0.1", 0), self._handler())
        self._server.daemon_threads = True
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.05,))

    @property
    def endpoint(self) -> str:
        return f"http://127.0.0.1:{self._server.server_address[1]}"

    def __enter__(self) -> "OddS3":
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._over.set()
        self._server.shutdown()
        self._thread.join()
        self._server.server_close()

    def answer(self, method: str, path: str, body: bytes, *, creates: bool) -> tuple[int, bytes]:
        while self.silent.is_set() and not self._over.wait(0.02):
            pass
        if self.says is not None:
            return self.says
        if method == "POST":  # DeleteObjects
            names = re.findall(r"<Key>(.*?)</Key>", body.decode())
            for name in names:
                self.objects.pop(f"{path}/{name}", None)
            gone = "".join(f"<Deleted><Key>{name}</Key></Deleted>" for name in names)
            return 200, f"<DeleteResult>{gone}</DeleteResult>".encode()
        if method == "PUT":
            if creates and path in self.objects:
                return error(412, "PreconditionFailed")
            self.objects[path] = body
            return 200, b""
        if path.count("/") == 1:  # ListObjectsV2
            return 200, b"<ListBucketResult></ListBucketResult>"
        return (200, self.objects[path]) if path in self.objects else error(404, "NoSuchKey")

    def _handler(self) -> type[BaseHTTPRequestHandler]:
        server = self

        class Handler(BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.1"

            def do(self) -> None:
                body = self.rfile.read(int(self.headers.get("Content-Length") or 0))
                path = self.path.partition("?")[0]
                creates = self.headers.get("If-None-Match") == "*"
                status, content = server.answer(self.command, path, body, creates=creates)
                self.send_response(status)
                self.send_header("Content-Length", str(len(content)))
                self.send_header("ETag", '"0"')
                self.send_header("Last-Modified", "Sat, 21 Nov 2026 08:00:00 GMT")
                self.end_headers()
                if self.command != "HEAD":
                    self.wfile.write(content)

            do_GET = do_HEAD = do_PUT = do_POST = do  # noqa: N815  (http.server asks for them)

            def log_message(self, *_: object) -> None:
                pass

        return Handler
