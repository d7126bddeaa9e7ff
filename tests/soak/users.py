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
from plateau.client.errors import ApiError
from plateau.farm.model.spec import JobSpec
from tests.support.farms.faulty_farm import BY_ZONES, SPEC
from tests.support.farms.receiver import SECRET

#: Orders that are under way at once.
ORDERS: Final = 8
_PAUSE_S: Final = (0.05, 0.6)  #: between two calls
_REFUSED: Final = frozenset({404, 409})  #: nothing to see yet, ended already, or removed meanwhile

_SMALL: Final = {"width": 48, "height": 32}
_QUICK: Final[dict[str, Any]] = {
    "step": 50,
    "slice_spp": 5,
    "max_spp": 600,
    "parameters": _SMALL,
    "rule": {"name": "fixed", "spp": 400},
}
_FIXED: Final[dict[str, Any]] = {**SPEC, "rule": {"name": "fixed", "spp": 240}}


@dataclass(frozen=True, kw_only=True)
class Kind:
    """A job, or a batch where it has levels of light, and what its user does with it.

    Whenever nothing is wrong, its image is the same.
    """

    spec: dict[str, Any] = field(default_factory=_QUICK.copy)
    weight: int = 1  #: how often it comes, compared with others
    is_analytic: bool = True
    levels: tuple[float, ...] = ()  #: of each frame, in a batch
    does: tuple[str, ...] = ()  #: what its user does
    has_notice: bool = False


KINDS: Final = {
    "frame": Kind(spec=SPEC, is_analytic=False, weight=2),
    "zones": Kind(spec=BY_ZONES, is_analytic=False, weight=2),
    "denoised": Kind(spec={**_FIXED, "denoise": {"name": "oidn"}}, is_analytic=False),
    "AOVs": Kind(
        spec={**_FIXED, "aovs": ["albedo", "normal", "depth", "shape_id"]}, is_analytic=False
    ),
    "analytic": Kind(weight=4),
    "analytic by zones": Kind(
        spec={
            **_QUICK,
            "parameters": {**_SMALL, "noise": "fireflies"},
            "allocation": {"name": "zones", "size": 16},
        }
    ),
    "with a notice": Kind(has_notice=True, weight=2),
    "paused and resumed": Kind(does=("pause", "resume")),
    "cancelled": Kind(spec={**_QUICK, "rule": {"name": "fixed", "spp": 600}}, does=("cancel",)),
    "batch": Kind(levels=(0.3, 0.5, 0.7)),
    "shot": Kind(
        spec={
            **_QUICK,
            "shot": {"fps": 24, "target": 9.0},
            "rule": {"name": "fixed", "spp": 40},
            "step": 20,
            "slice_spp": 10,
            "max_spp": 400,
        },
        levels=(0.3, 0.5, 0.4, 0.3),
    ),
}


@dataclass
class Order:
    """What one call has submitted."""

    kind: str
    jobs: list[str]
    steps: list[str]  #: what its user is still to do


@dataclass(frozen=True)
class Desk:
    """Where orders are given: by clients of several APIs."""

    clients: Sequence[Client]
    scenes: Mapping[bool, Path]  #: by whether it is analytic
    hook: str  #: URL of a receiver

    def order(self, name: str, by: Client, **more: object) -> Order:
        """Submit a job or a batch of this kind."""
        kind = KINDS[name]
        fields: dict[str, Any] = {**kind.spec, **more}
        if kind.has_notice:
            fields["notice"] = {"url": self.hook, "secret": SECRET}
        scene = self.scenes[kind.is_analytic]
        if kind.levels:
            spec = JobSpec.model_validate({**fields, "batch": f"{name} {secrets.token_hex(4)}"})
            frames = [{"level": level} for level in kind.levels]
            jobs = by.submit_batch(scene, frames, spec).job_ids
        else:
            jobs = [by.submit(scene, JobSpec.model_validate(fields)).id]
        return Order(name, list(jobs), list(kind.does))


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
            except Exception as error:
                if not (isinstance(error, ApiError) and error.status in _REFUSED):
                    self.trouble.append(repr(error))
                    raise

    def _act(self, client: Client) -> None:
        if len(self.orders) < ORDERS and not self.is_closing:
            weights = [kind.weight for kind in KINDS.values()]
            (name,) = self._random.choices(list(KINDS), weights)
            priority = self._random.randint(-2, 2)
            self.calls["submit"] += 1
            self.orders.append(self._desk.order(name, client, priority=priority))
        for order in list(self.orders):
            if order.steps and client.job(order.jobs[0]).points:
                self._steer(client, order)
        if self.orders:
            job = self._random.choice(self._random.choice(self.orders).jobs)
            look = self._random.choice(("jobs", "job", "curve", "image", "slices", "happened"))
            self.calls[look] += 1
            getattr(client, look)(*[job] if look != "jobs" else [])

    def _steer(self, client: Client, order: Order) -> None:
        self.calls[order.steps[0]] += 1
        for job in order.jobs:
            try:
                getattr(client, order.steps[0])(job)
            except ApiError as error:
                if error.status not in _REFUSED:
                    raise
        order.steps.pop(0)
