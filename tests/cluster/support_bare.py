"""A farm on a Redis of its own, as on machines of one's own: with TLS, users, and sentinels."""

import os
import signal
import ssl
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import redis
import trustme

from plateau.client import Client
from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.model.errors import StoreUnavailable
from plateau.farm.redis.acl import rules
from tests.support.farms.real_farm import RealFarm

DEPLOY = Path(__file__).parents[2] / "deploy" / "redis"

#: Whom the tests look with; the rest is what `plateau redis-acl` prints.
ROOT, ROOT_PASSWORD = "root", "only in tests"


@dataclass(frozen=True)
class Certificates:
    """Files: who signs, what a server shows, and what a client does."""

    ca: Path
    server: tuple[Path, Path]
    client: tuple[Path, Path]


def certificates(folder: Path) -> Certificates:
    """Certificates of an authority of our own."""
    folder.mkdir()
    authority = trustme.CA()
    authority.cert_pem.write_to_path(folder / "ca.pem")

    def issue(name: str, *identities: str) -> tuple[Path, Path]:
        made = authority.issue_cert(*identities)
        made.cert_chain_pems[0].write_to_path(folder / f"{name}.pem")
        made.private_key_pem.write_to_path(folder / f"{name}.key")
        return folder / f"{name}.pem", folder / f"{name}.key"

    server = issue("server", "localhost", "127.0.0.1")
    return Certificates(folder / "ca.pem", server, issue("client", "worker.example"))


def users(folder: Path) -> tuple[Path, Path]:
    """An ACL file as the command prints it, the tests' own user in it too, and the passwords."""
    passwords = folder / "passwords"
    printed = subprocess.run(
        [sys.executable, "-m", "plateau", "redis-acl", "--passwords", str(passwords)],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        check=True,
    ).stdout
    acl = folder / "users.acl"
    acl.write_text(f"{printed}user {ROOT} on >{ROOT_PASSWORD.replace(' ', '_')} ~* &* +@all\n")
    return acl, passwords


def tls_lines(tls: Certificates) -> list[str]:
    """What a server or a sentinel has in its configuration to show its certificate."""
    return [
        "bind 127.0.0.1",
        f"tls-cert-file {tls.server[0]}",
        f"tls-key-file {tls.server[1]}",
        f"tls-ca-cert-file {tls.ca}",
    ]


def server_lines(tls: Certificates, acl: Path, port: int) -> list[str]:
    """The configuration of a server as it is deployed, with TLS and users at a port of its own."""
    own = [f"tls-port {port}", "tls-auth-clients yes", f"aclfile {acl}"]
    return [f"include {DEPLOY / 'redis.conf'}", *tls_lines(tls), *own]


class Server:
    """A process of Redis's: a server or a sentinel, by a configuration file that it may rewrite."""

    def __init__(self, program: Path, folder: Path, lines: list[str], *more: str) -> None:
        folder.mkdir()
        self.log = folder / "log"
        config = folder / "redis.conf"
        config.write_text("\n".join([f"dir {folder}", f"logfile {self.log}", *lines]) + "\n")
        self._command = [str(program), str(config), *more]
        self.start()

    def start(self) -> None:
        """Start it, again too, on what it has."""
        self.process = subprocess.Popen(self._command, stdout=subprocess.DEVNULL)

    def kill(self) -> None:
        """End it as a power loss would."""
        self.process.kill()
        self.process.wait()

    def stop(self) -> None:
        """End it."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGTERM)
            self.process.wait(30)


def answers(client: redis.Redis, seconds: float = 30) -> redis.Redis:
    """The client, once its server answers."""
    deadline = time.monotonic() + seconds
    while True:
        try:
            client.ping()
            return client
        except (StoreUnavailable, redis.exceptions.RedisError):
            assert time.monotonic() < deadline, "Redis does not answer"
            time.sleep(0.05)


class BareFarm(RealFarm):
    """A farm whose processes find Redis by settings of their own, each as its own user.

    Parameters
    ----------
    folder, cache
        For blobs and logs, and for what is compiled.
    client
        The test's own, which may do everything.
    settings_of
        Settings by role: ``api``, ``monitor``, ``worker``, and ``admin`` for commands.
    """

    def __init__(
        self,
        folder: Path,
        cache: Path,
        client: redis.Redis,
        settings_of: Callable[[str], dict[str, str]],
        **settings: str,
    ) -> None:
        self._settings_of = settings_of
        self._logs = folder / "logs"
        self._logs.mkdir()
        self.environment = {
            **os.environ,
            "PLATEAU_BLOBS": str(folder / "blobs"),
            "PLATEAU_CACHE": str(cache),
            "PLATEAU_THREADS": "1",
            "PLATEAU_LEASE_S": "3",
            **settings,
        }
        self.store = Blobs(str(folder / "blobs"))
        self.redis = self  # type: ignore[assignment]  # whose stop() is ours
        self.redis_client = client
        self.jobs = Jobs(client)
        self.processes = []
        _, self.url = self.start_api()
        self.client = Client(self.url)

    def stop(self) -> None:
        print(self.logs())  # for who looks why a test has failed

    def start(
        self,
        *arguments: str,
        passed: tuple[int, ...] = (),
        module: str = "plateau",
        **environment: str,
    ) -> subprocess.Popen[bytes]:
        log = self._logs / f"{arguments[0]}-{len(list(self._logs.iterdir()))}"
        with log.open("wb") as said:
            process = subprocess.Popen(
                [sys.executable, "-m", module, *arguments],
                env={**self.environment, **self._settings_of(arguments[0]), **environment},
                stderr=said,
                pass_fds=passed,
                start_new_session=True,
            )
        self.processes.append(process)
        return process

    def command(self, *arguments: str, **changed: str) -> subprocess.CompletedProcess[str]:
        """A command of plateau's, run to its end by the admin, with these settings changed."""
        settings = {**self.environment, **self._settings_of("admin"), "PLATEAU_URL": self.url}
        return subprocess.run(
            [sys.executable, "-m", "plateau", *arguments],
            env=settings | changed,
            capture_output=True,
            text=True,
            check=False,
        )

    def logs(self) -> str:
        """All that its processes have said."""
        return "\n".join(file.read_text() for file in self._logs.iterdir())


#: A role's settings.
SettingsOf = Callable[[str], dict[str, str]]


def credentials(passwords: Path, tls: Certificates, address: str) -> SettingsOf:
    """Settings by role: where Redis is, who asks, with what password, over what certificates."""

    def settings_of(role: str) -> dict[str, str]:
        user = f"plateau-{role}"
        if user not in rules():
            user = "plateau-admin"
        return {
            "PLATEAU_REDIS_URL": address,
            "PLATEAU_REDIS_USER": user,
            "PLATEAU_REDIS_PASSWORD_FILE": str(passwords / f"{user}.password"),
            "PLATEAU_REDIS_CA": str(tls.ca),
            "PLATEAU_REDIS_CERT": str(tls.client[0]),
            "PLATEAU_REDIS_KEY": str(tls.client[1]),
        }

    return settings_of


def tls_options(tls: Certificates) -> dict[str, object]:
    """What a client of the tests' own needs, as redis-py's options."""
    return {
        "ssl": True,
        "ssl_ca_certs": str(tls.ca),
        "ssl_certfile": str(tls.client[0]),
        "ssl_keyfile": str(tls.client[1]),
        "ssl_min_version": ssl.TLSVersion.TLSv1_2,
        "decode_responses": True,
        "username": ROOT,
        "password": ROOT_PASSWORD.replace(" ", "_"),
    }
