"""Real S3 servers, and a network between them and a farm that loses answers."""

import hashlib
import hmac
import json
import os
import signal
import socket
import subprocess
import time
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import httpx

from tests.support.faults.relay import Relay
from tests.support.processes.ports import free_ports

BUCKET = "farm"
KEY, SECRET = "plateau", "secret-of-the-tests"


class S3Server:
    """versitygw or minio with one bucket, until the context ends.

    Parameters
    ----------
    program
        Which of the two, by its name.
    folder
        Of its own.
    certificate, private_key
        PEM files, where it is to speak TLS; versitygw alone.
    """

    def __init__(
        self,
        program: Path,
        folder: Path,
        certificate: Path | None = None,
        private_key: Path | None = None,
    ) -> None:
        self.data = folder / "data"
        (self.data / BUCKET).mkdir(parents=True)
        self._log = folder / "log"
        self._address = f"127.0.0.1:{free_ports()[0]}"
        self.endpoint = f"{'https' if certificate else 'http'}://{self._address}"
        if program.name == "minio":
            options = ("server", "--quiet", "--address", self._address, str(self.data))
        else:
            tls = ("--cert", str(certificate), "--key", str(private_key)) if certificate else ()
            (folder / "users").mkdir()
            users = ("--iam-dir", str(folder / "users"))
            options = ("--port", self._address, *users, *tls, "posix", str(self.data))
        self._command = (str(program), *options)
        self._process: subprocess.Popen[bytes] | None = None
        self._users: dict[str, list[dict[str, object]]] = {}

    @property
    def environment(self) -> dict[str, str]:
        """What a process needs that is to use it."""
        return {
            "AWS_ENDPOINT_URL": self.endpoint,
            "AWS_ACCESS_KEY_ID": KEY,
            "AWS_SECRET_ACCESS_KEY": SECRET,
        }

    def user(self, name: str, rights: Path) -> dict[str, str]:
        """What a process needs of a new user, who may do in the bucket what a policy says."""
        endpoint = ("--access", KEY, "--secret", SECRET, "--endpoint-url", self.endpoint)
        user = ("--access", name, "--secret", f"{SECRET}-of-{name}", "--role", "user")
        command = (self._command[0], "admin", *endpoint, "create-user", *user)
        subprocess.run(command, check=True, capture_output=True)
        self._users[name] = json.loads(rights.read_text())["Statement"]
        statements = [
            {**statement, "Principal": {"AWS": [user]}}
            for user, theirs in self._users.items()
            for statement in theirs
        ]
        policy = {"Version": "2012-10-17", "Statement": statements}
        self._ask("PUT", f"/{BUCKET}", "policy=", json.dumps(policy).encode())
        return {"AWS_ACCESS_KEY_ID": name, "AWS_SECRET_ACCESS_KEY": f"{SECRET}-of-{name}"}

    def __enter__(self) -> "S3Server":
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.kill(signal.SIGTERM)

    def start(self) -> None:
        """Start it, again where it was killed: on the same port, with what it stored."""
        credentials = {
            "ROOT_ACCESS_KEY": KEY,
            "ROOT_SECRET_KEY": SECRET,
            "MINIO_ROOT_USER": KEY,
            "MINIO_ROOT_PASSWORD": SECRET,
            "MINIO_BROWSER": "off",
        }
        with self._log.open("ab") as log:
            self._process = subprocess.Popen(
                self._command, env={**os.environ, **credentials}, stdout=log, stderr=log
            )
        host, port = self._address.split(":")
        deadline = time.monotonic() + 60
        while True:
            assert self._process.poll() is None, self._log.read_text()
            try:
                socket.create_connection((host, int(port)), timeout=1).close()
            except OSError:
                assert time.monotonic() < deadline, self._log.read_text()
                time.sleep(0.05)
            else:
                return

    def kill(self, by: signal.Signals = signal.SIGKILL) -> None:
        if self._process is not None:
            self._process.send_signal(by)
            self._process.wait(60)
            self._process = None

    def _ask(self, method: str, path: str, query: str, body: bytes) -> None:
        """Ask as its owner what obstore does not: signed as AWS's Signature Version 4 says."""
        now = datetime.now(timezone.utc).strftime("%Y%m%dT%H%M%SZ")
        digest = hashlib.sha256(body).hexdigest()
        headers = {"host": self._address, "x-amz-content-sha256": digest, "x-amz-date": now}
        names = ";".join(headers)
        lines = [f"{name}:{value}" for name, value in headers.items()]
        request = "\n".join([method, path, query, *lines, "", names, digest])
        scope = f"{now[:8]}/us-east-1/s3/aws4_request"
        hashed = hashlib.sha256(request.encode()).hexdigest()
        key = f"AWS4{SECRET}".encode()
        for part in scope.split("/"):
            key = hmac.digest(key, part.encode(), "sha256")
        to_sign = f"AWS4-HMAC-SHA256\n{now}\n{scope}\n{hashed}"
        signature = hmac.digest(key, to_sign.encode(), "sha256").hex()
        headers["authorization"] = (
            f"AWS4-HMAC-SHA256 Credential={KEY}/{scope}, SignedHeaders={names}, "
            f"Signature={signature}"
        )
        url = f"{self.endpoint}{path}?{query}"
        httpx.request(method, url, content=body, headers=headers, timeout=60).raise_for_status()


class Network(Relay):
    """Forwards TCP connections to an S3 server, but for what it is told to lose.

    `lose` drops the answer to each request whose first line has these words, so many times, and
    closes its connection: it was done, and nobody was told. While `silent`, nothing is forwarded in
    either direction and nothing closed, as when a cable is cut.
    """

    def __init__(self, server: S3Server) -> None:
        host, _, port = server.endpoint.partition("://")[2].partition(":")
        self._target = host, int(port)
        self.silent = False
        self.lost = 0
        self._words = b""
        self._times = 0
        super().__init__()
        self.endpoint = f"http://{self.address}"

    def lose(self, words: str, times: int = 1) -> None:
        self._words, self._times, self.lost = words.encode(), times, 0

    def connected(self) -> socket.socket:
        return socket.create_connection(self._target)

    def passes(self, piece: bytes, asks: bool, about: dict[str, Any]) -> bool:
        line = piece.partition(b"\r\n")[0]
        if asks and line.endswith(b" HTTP/1.1"):
            about["asked"] = line
        while self.silent:
            time.sleep(0.02)
        if not asks and self._times and self._words in about["asked"]:
            self._times -= 1
            self.lost += 1
            raise ConnectionResetError
        return True
