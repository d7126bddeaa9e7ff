"""The requests of `bench.api` to a farm, of each kind in each phase, and their latencies."""

from __future__ import annotations

import asyncio
import json
import os
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import count, repeat
from pathlib import Path
from typing import TYPE_CHECKING

import httpx

from bench import ROOT
from bench.support.cores import others_meanwhile
from bench.support.farms.service_farm import BATCH, ServiceFarm
from bench.support.load.http_load import Call, at_a_rate, at_once, get, in_turn, post_form
from bench.support.load.watchers import Watchers
from plateau.client import Client
from plateau.farm.model.spec import FixedSpec, JobSpec, Variant
from plateau.scenes import FOLDER

if TYPE_CHECKING:
    from collections.abc import Iterator

#: The farm's job is paused; it renders; it renders while hundreds watch.
PHASES = ("idle", "rendering", "watched")
#: No worker here has this variant, so that a posted job stays in the queue.
_POSTED = JobSpec(variant="cuda_ad_rgb", priority=-1000)
_SCENE = """<scene version="3.0.0">
  <integrator type="path"/>
  <sensor type="perspective"><film type="hdrfilm">
    <integer name="width" value="64"/><integer name="height" value="64"/>
  </film></sensor>
  <shape type="sphere"><bsdf type="diffuse"/></shape>
  <emitter type="constant"/>
  <!-- {} -->
</scene>
"""


@dataclass(frozen=True, kw_only=True)
class Plan:
    """How much is asked of the farm."""

    jobs: int = 10_000  #: in the list
    watchers: int = 500
    rounds: int = 3
    seconds: float = 20.0  #: of GETs, and of watching, in each phase
    per_s: float = 20.0  #: GETs a second of each kind
    turns: int = 20  #: of pages and of POSTs, in each phase
    callers: int = 8  #: that POST at once
    size: int = 256  #: of the image that is rendered, in pixels
    slice_spp: int = 25  #: and a point after each
    threads: int = field(default_factory=lambda: len(os.sched_getaffinity(0)))
    variant: Variant = "auto"


@dataclass(frozen=True)
class Found:
    """The measurements of all rounds; times are in seconds."""

    latencies: dict[str, dict[str, list[list[float]]]]  #: by phase, request and round
    rates: dict[str, list[float]]  #: POSTs a second of all callers, by phase
    delays: list[list[float]]  #: from each point's time until the last watcher had it, by round
    bare_delays: list[list[float]]  #: the same for the bare app's events
    others: list[float]  #: other work's share of the cores, the host's included


def measure(plan: Plan) -> Found:
    """Put this load on a farm and return the measurements."""
    found = Found(defaultdict(lambda: defaultdict(list)), defaultdict(list), [], [], [])
    with tempfile.TemporaryDirectory() as folder:
        farm = ServiceFarm(Path(folder), jobs=plan.jobs, threads=plan.threads)
        with farm, Client(farm.url) as client:
            cap = 1_000_000 // plan.slice_spp * plan.slice_spp
            job = client.submit(
                FOLDER / "box",
                JobSpec(
                    step=plan.slice_spp,
                    slice_spp=plan.slice_spp,
                    max_spp=cap,
                    rule=FixedSpec(spp=cap),
                    variant=plan.variant,
                    parameters={"width": plan.size, "height": plan.size},
                ),
            ).id
            farm.wait(lambda: client.job(job).points > 1)
            scene = Path(folder) / "scene.xml"
            scene.write_text(_SCENE)
            stored = client.submit(scene, _POSTED).scene_sha256
            load = _Load(plan, farm, job, stored)
            with _bare_app(load.samples()) as load.bare:
                for number in range(plan.rounds):
                    load.take_round(found)
                    print(f"round {number + 1} of {plan.rounds} done", file=sys.stderr)
    return found


class _Load:
    """Requests to a farm, and to the bare app beside it."""

    def __init__(self, plan: Plan, farm: ServiceFarm, job: str, stored: str) -> None:
        self.bare = ""
        self._plan = plan
        self._farm = farm
        self._job = job
        self._stored = stored
        self._numbers = count()
        self._pages = {
            "start": "limit=50",
            "middle": f"limit=50&cursor={plan.jobs // 2}",
            "end": "limit=50&cursor=51",
            "state=failed": "limit=50&state=failed",
            "batch=…": f"limit=50&batch={BATCH.replace(' ', '%20')}",
        }

    def samples(self) -> dict[str, str]:
        """Return the bare app's answers: a job, a page, an event's data."""
        url = f"{self._farm.url}/v1/jobs"
        with httpx.Client(trust_env=False) as http:
            happened = http.get(
                f"{url}/{self._job}/events", headers={"Accept": "application/json"}
            ).json()["events"]
            return {
                "job": http.get(f"{url}/{self._job}").text,
                "page": http.get(f"{url}?limit=50").text,
                "point": next(json.dumps(e["data"]) for e in happened if e["type"] == "point"),
            }

    def take_round(self, found: Found) -> None:
        """Measure everything once in each phase."""
        events = f"/v1/jobs/{self._job}/events"
        for phase in PHASES:
            self._farm.steer(self._job, "pause" if phase == "idle" else "resume")
            with others_meanwhile() as others:
                if phase == "watched":
                    with Watchers(self._farm.url, events, self._plan.watchers) as watch:
                        self._take_latencies(found, phase)
                    found.delays.append(_delays(watch))
                    with Watchers(self.bare, "/stream/point", self._plan.watchers) as watch:
                        time.sleep(self._plan.seconds)
                    found.bare_delays.append(_delays(watch))
                else:
                    self._take_latencies(found, phase)
            found.others.append(others.share)
            self._farm.clear(keep=self._job)

    def _take_latencies(self, found: Found, phase: str) -> None:
        ours = f"/v1/jobs/{self._job}"
        gets = {
            "GET a job": self._call(ours),
            "GET a job's bytes, bare": Call(self.bare, get("/job")),
            "GET /healthz": self._call("/healthz"),
        }
        pages = {
            f"page: {name}": repeat(self._call(f"/v1/jobs?{query}"))
            for name, query in self._pages.items()
        }
        pages["page, bare"] = repeat(Call(self.bare, get("/page")))
        posts = {
            "POST a new scene": self._new_scenes(self._farm.url, "/v1/jobs"),
            "POST a job of a stored scene": self._jobs_of_stored(),
            "POST, bare": self._new_scenes(self.bare, "/job"),
        }
        plan = self._plan
        took = [
            asyncio.run(at_a_rate(gets, per_s=plan.per_s, seconds=plan.seconds)),
            asyncio.run(in_turn(pages, turns=plan.turns)),
            asyncio.run(in_turn(posts, turns=plan.turns)),
        ]
        for name, seconds in (item for one in took for item in one.items()):
            found.latencies[phase][name].append(seconds)
        many = self._new_scenes(self._farm.url, "/v1/jobs")
        rate = asyncio.run(at_once(many, callers=plan.callers, turns=plan.turns // 2))
        found.rates[phase].append(rate)

    def _call(self, path: str) -> Call:
        return Call(self._farm.url, get(path))

    def _new_scenes(self, url: str, path: str) -> Iterator[Call]:
        fields = {"spec": _POSTED.model_dump_json()}
        for number in self._numbers:
            yield Call(url, post_form(path, fields, _SCENE.format(number).encode()))

    def _jobs_of_stored(self) -> Iterator[Call]:
        fields = {"spec": _POSTED.model_dump_json(), "scene_sha256": self._stored}
        return repeat(Call(self._farm.url, post_form("/v1/jobs", fields)))


def _delays(watch: Watchers) -> list[float]:
    if not watch.received:
        raise AssertionError("no point came while it was watched")
    return [point.last - point.at for point in watch.received]


@contextmanager
def _bare_app(answers: dict[str, str]) -> Iterator[str]:
    """Start a bare app with these answers; yield its URL."""
    with subprocess.Popen(
        [sys.executable, "-m", "bench.support.bare.app"],
        cwd=ROOT,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        if process.stdin is None or process.stdout is None:
            raise AssertionError("it was started with pipes")
        json.dump(answers, process.stdin)
        process.stdin.close()
        try:
            yield process.stdout.readline().strip()
        finally:
            process.terminate()
