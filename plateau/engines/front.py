"""A run's own machine, its *front*: where nodes reach it, and what they say if they do not."""

import fcntl
import json
import os
import socket
import struct
from contextlib import suppress
from dataclasses import asdict, dataclass
from typing import Final

from plateau.errors import ExitCode
from plateau.farm.model import versions
from plateau.farm.process.settings import Settings
from plateau.farm.redis.url import is_loopback
from plateau.processes.read_settings import REDIS_VARIABLES

#: The variable that tells a node of its front.
VARIABLE: Final = "PLATEAU_FRONT"

#: Exit codes of a node that cannot work for a run, beside `ExitCode.INCOMPATIBLE`.
CANNOT_REACH: Final = os.EX_UNAVAILABLE
CANNOT_IMPORT: Final = os.EX_OSFILE  # worker.sbatch has it too
_NO_PROGRAM: Final = (126, 127)  # a shell's
NOT_LET_IN: Final = os.EX_NOPERM

#: Variables of this process that no node inherits: secrets, and what is about this machine.
KEPT_HERE: Final = frozenset(
    {
        *("PLATEAU_KEY", "PLATEAU_KEY_FILE", "PLATEAU_WEBHOOK_SECRET", "PLATEAU_ALIVE_FILE"),
        *("PLATEAU_LEAVE_AFTER_S", "PLATEAU_DATA", "PLATEAU_URL", "PLATEAU_THREADS", VARIABLE),
    }
)
_SIOCGIFADDR: Final = 0x8915


@dataclass(frozen=True)
class Front:
    """A run's own machine, as a node is told of it."""

    hosts: tuple[str, ...]  #: its names and addresses, of which a node takes one that answers
    redis_port: int
    blobs_port: int
    secret: str  #: of both; letters and digits
    version: str  #: of Plateau

    @classmethod
    def here(cls, redis_port: int, blobs_port: int, secret: str) -> "Front":
        """This machine."""
        return cls(_hosts(), redis_port, blobs_port, secret, versions.plateau())

    @classmethod
    def told(cls) -> "Front | None":
        """The front that this process was told of; None where it is no run's."""
        given = os.environ.pop(VARIABLE, "")
        return cls(**json.loads(given)) if given else None

    def environment(self, settings: Settings) -> dict[str, str]:
        """Every PLATEAU_… variable of this run's workers; `settings` has their pool and tags."""
        own = {name: value for name, value in os.environ.items() if name.startswith("PLATEAU_")}
        return {
            **{name: value for name, value in own.items() if name not in KEPT_HERE},
            **dict.fromkeys(REDIS_VARIABLES, ""),  # the URL contains them
            "PLATEAU_POOL": settings.pool,
            "PLATEAU_TAGS": ",".join(settings.tags),
            VARIABLE: json.dumps(asdict(self)),
        }

    def redis_url(self, host: str) -> str:
        """The URL of its Redis at one of the hosts."""
        return f"redis://:{self.secret}@{host}:{self.redis_port}"

    def blobs(self, host: str) -> str:
        """The URL of its blobs at one of the hosts."""
        return f"http://{self.secret}@{host}:{self.blobs_port}"

    def unfit(self, code: int | None, python: str) -> str:
        """Why a node whose task ended with this exit code cannot work, and what to do."""
        if code in _NO_PROGRAM:
            code = CANNOT_IMPORT
        tried = ", ".join(f"{host}:{self.redis_port}" for host in self.hosts)
        return {
            CANNOT_IMPORT: f"it cannot run Plateau by {python}; install Plateau where the nodes "
            "see it, or name their interpreter by PLATEAU_PYTHON",
            ExitCode.INCOMPATIBLE.value: f"it has another Plateau than this machine's "
            f"{self.version}; install the same on both, or name the interpreter by PLATEAU_PYTHON",
            CANNOT_REACH: f"it cannot reach this machine; it tried {tried}, and the port "
            f"{self.blobs_port}: the network must let nodes connect to them",
            NOT_LET_IN: f"what answers it at {tried} is not the Redis of this run",
        }.get(code or 0, f"its worker ended with exit code {code}")


def _hosts() -> tuple[str, ...]:
    """This machine's names and IPv4 addresses; those that mean it on itself alone come last."""
    found = [socket.getfqdn(), socket.gethostname()]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        for _, name in socket.if_nameindex():
            with suppress(OSError):  # it has no such address
                asked = struct.pack("256s", name.encode()[:15])
                found.append(socket.inet_ntoa(fcntl.ioctl(one, _SIOCGIFADDR, asked)[20:24]))
    others = [host for host in dict.fromkeys(found) if not is_loopback(host)]
    return tuple(others) or ("127.0.0.1",)
