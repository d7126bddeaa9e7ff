"""The users of a soaked farm: they submit, look, pause, resume and cancel, whatever happens."""

import random
import secrets
import threading
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from plateau.client import Client
from plateau.client.errors import ApiError, ClientError
from plateau.farm.model.spec import JobSpec
from tests.soak.kinds import KINDS, Kind
from tests.support.farms.receiver import SECRET

#: Orders that are under way at once.
ORDERS: Final = 8
_PAUSE_S: Final = (0.05, 0.6)  #: between two calls
_REFUSED: Final = frozenset({404, 409})  #: nothing to see yet, ended already, or removed meanwhile


@dataclass
class Order:
    """What one call has submitted."""

    kind: Kind
    jobs: list[str]
    steps: list[str] = field(default_factory=list)  #: what its user is still to do


@dataclass(frozen=True)
class Desk:
    """Where orders are given: by clients of several APIs."""

    clients: Sequence[Client]
    scenes: Mapping[bool, Path]  #: by whether it is analytic
    hook: str  #: URL of a receiver

    def order(self, kind: Kind, by: Client, **more: object) -> Order:
        """Submit a job or a batch of this kind."""
        fields: dict[str, Any] = {**kind.spec, **more}
        if kind.frames:
            fields["batch"] = f"{kind.name} {secrets.token_hex(4)}"
        if kind.has_notice:
            fields["notice"] = {"url": self.hook, "secret": SECRET}
        spec, scene = JobSpec.model_validate(fields), self.scenes[kind.is_analytic]
        if kind.frames:
            jobs = by.submit_batch(scene, kind.frames, spec).job_ids
        else:
            jobs = [by.submit(scene, spec).id]
        steps = {"": [], "pause": ["pause", "resume"], "cancel": ["cancel"]}[kind.does]
        return Order(kind, list(jobs), steps)


class Users(threading.Thread):
    """They act until the context ends; what they may not meet is in `trouble`."""

    def __init__(self, desk: Desk, seed: int) -> None:
        super().__init__(name="users", daemon=True)
        self._desk = desk
        self._random = random.Random(seed)
        self._over = threading.Event()
        self.is_closing = False  #: whether nothing more is ordered
        self.orders: list[Order] = []
        self.trouble: list[str] = []
        self.calls = Counter[str]()

    def __enter__(self) -> "Users":
        self.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._over.set()
        self.join()

    def run(self) -> None:
        while not self._over.wait(self._random.uniform(*_PAUSE_S)):
            try:
                self._act(self._random.choice(self._desk.clients))
            except ApiError as error:
                if error.status not in _REFUSED:
                    self.trouble.append(f"{error.status} {error.slug}: {error}")
            except ClientError as error:
                self.trouble.append(repr(error))
            except Exception as error:
                self.trouble.append(repr(error))
                raise

    def _act(self, client: Client) -> None:
        if len(self.orders) < ORDERS and not self.is_closing:
            (kind,) = self._random.choices(KINDS, [one.weight for one in KINDS])
            priority = self._random.randint(-2, 2)
            self._count("submit")
            self.orders.append(self._desk.order(kind, client, priority=priority))
        for order in list(self.orders):
            if order.steps and client.job(order.jobs[0]).points:
                self._steer(client, order)
        if self.orders:
            self._look(client, self._random.choice(self._random.choice(self.orders).jobs))

    def _steer(self, client: Client, order: Order) -> None:
        step = order.steps[0]
        self._count(step)
        for job in order.jobs:
            try:
                getattr(client, step)(job)
            except ApiError as error:
                if error.status not in _REFUSED:
                    raise
        order.steps.pop(0)

    def _look(self, client: Client, job: str) -> None:
        look = self._random.choice(("jobs", "job", "curve", "image", "slices", "happened"))
        self._count(look)
        if look == "jobs":
            client.jobs()
        else:
            getattr(client, look)(job)

    def _count(self, call: str) -> None:
        self.calls[call] += 1
