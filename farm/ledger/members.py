"""Monitors and APIs as members of a farm: their heartbeats, and the versions that they speak.

A worker must speak what all of them speak; see `plateau.farm.model.versions`.
"""

import json
import logging
import os
import random
import secrets
import socket
import threading
from collections.abc import Callable
from datetime import datetime, timezone
from typing import Final

from plateau.farm.model import versions
from plateau.farm.model.errors import Refused
from plateau.farm.model.job import moment
from plateau.farm.model.worker import ProcessRole, RefusedProcess
from plateau.farm.redis import keys
from plateau.farm.redis.client import RedisClient
from plateau.farm.redis.commands import workers as commands
from plateau.farm.redis.commands.members import ApiHeartbeat
from plateau.farm.redis.link import now_ms, unavailable_as_farm_error
from plateau.farm.redis.scripts import Scripts

_LOG = logging.getLogger(__name__)

_UPGRADE_S: Final = 30.0  #: between two tries of a refused process to join


class Membership:
    """An API's membership: it lasts from heartbeat to heartbeat, until the API signs off."""

    def __init__(self, client: RedisClient, lease_s: float) -> None:
        self.id = process_id()
        self._scripts = Scripts(client)
        self._life_ms = round(lease_s * 1000)
        self._started_at = datetime.now(timezone.utc)

    def heartbeat(self) -> None:
        """Report that the API lives, for the length of a lease.

        Raises
        ------
        Refused
            It speaks no version that all other APIs and monitors speak.
        WrongLayout
            The data has another layout by now.
        StoreUnavailable
            Redis is away.
        """
        about = {
            "id": self.id,
            "host": socket.gethostname(),
            "pid": os.getpid(),
            "started_at": self._started_at.isoformat(),
        }
        self._say(json.dumps(about))

    def sign_off(self) -> None:
        """Report that the API stops."""
        self._say(None)

    def _say(self, about: str | None) -> None:
        self._scripts.run(ApiHeartbeat(api=self.id, about=about, life_ms=self._life_ms))


def process_id() -> str:
    """A unique id for this process: its machine, its process id, and a random part."""
    return f"{socket.gethostname()}-{os.getpid()}-{secrets.token_hex(2)}"


def sign_on(
    client: RedisClient,
    role: ProcessRole,
    heartbeat: Callable[[], None],
    stop: threading.Event,
    *,
    patient: bool,
) -> None:
    """Return once the process's first heartbeat was accepted, or `stop` is set.

    Raises
    ------
    Refused
        It does not speak the farm's versions. With `patient` it waits for an upgrade instead.
    StoreUnavailable
        Redis is away.
    """
    while not stop.is_set():
        try:
            heartbeat()
        except Refused as refused:
            note_refused(client, role, refused)
            if not patient:
                raise
            _LOG.error("out of service: %s", refused)
            wait_for_upgrade(stop)
        else:
            return


def wait_for_upgrade(stop: threading.Event) -> None:
    """Return when a refused process may try again, or once `stop` is set."""
    stop.wait(_UPGRADE_S * random.uniform(0.5, 1.5))


def note_refused(client: RedisClient, role: ProcessRole, why: Refused) -> None:
    """Note that this process was refused, for an hour, for people who look for it."""
    host = socket.gethostname()
    about = {
        "role": role,
        "host": host,
        "pid": os.getpid(),
        "plateau": versions.plateau(),
        "why": str(why),
    }
    Scripts(client).run(commands.Refused(who=f"{role} {host}", about=json.dumps(about)))


def refused_within(client: RedisClient, seconds: float) -> list[RefusedProcess]:
    """The processes that were refused in the last `seconds`, the newest first."""
    with unavailable_as_farm_error():
        texts = client.hvals(keys.REFUSED)
        now = moment(now_ms(client))
    found = [
        RefusedProcess(**json.loads(noted["about"]), at=moment(noted["at"]))
        for noted in map(json.loads, texts)
    ]
    recent = [one for one in found if (now - one.at).total_seconds() < seconds]
    return sorted(recent, key=lambda one: one.at, reverse=True)
