"""How much one slow worker among fast ones holds up a job: `python -m bench.mixed`.

Real Redis and a real monitor; simulated workers, of which one takes ten times as long as the others
for a slice. Its slices hold up the image, unless those that are late are given to a second worker.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING
from unittest import mock

from bench.support.farms.noise_workers import working
from bench.support.farms.scale_farm import ControlPlane
from bench.support.farms.synthetic_noise import Render
from bench.support.report import figure, write_report
from plateau.farm.blobs.store import Blobs
from plateau.farm.model.spec import FixedSpec, JobSpec
from plateau.farm.redis import scripts

if TYPE_CHECKING:
    from collections.abc import Iterator

    from plateau.farm.ledger.jobs import Jobs

SIZE = 64
SLOWNESS = 10.0
_FACTOR = "LATE_FACTOR, LATE_LEAST_MS, USUAL_OF = 2,"
_PATIENCE_S = 600.0


@dataclass(frozen=True)
class Case:
    """Who renders, and whether late slices are tried twice."""

    name: str
    workers: int
    slow: int = 0  #: so many of them
    second_tries: bool = True


CASES = (
    Case("four alike", 4),
    Case("three alike", 3),
    Case("three and a slow one", 4, slow=1),
    Case("three and a slow one, no second tries", 4, slow=1, second_tries=False),
)


@dataclass(frozen=True)
class Ended:
    """One job."""

    seconds: float  #: from its first lease to its end
    wasted: float  #: of the samples rendered for it, beyond those in its image
    second_tries: int


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pass-ms", type=float, default=100, help="a slice has seven passes")
    parser.add_argument("--spp", type=int, default=600)
    parser.add_argument("--jobs", type=int, default=3)
    options = parser.parse_args()

    figures = []
    for case in CASES:
        found = measure(case, options.pass_ms / 1000, options.spp, options.jobs)
        print(f"{case.name}: {found}", file=sys.stderr)
        figures += [
            figure(f"{case.name}: a job", [one.seconds for one in found], "s"),
            figure(f"{case.name}: wasted", [one.wasted for one in found], "of its samples"),
            figure(f"{case.name}: second tries", [one.second_tries for one in found], "slices"),
        ]
    write_report(
        "mixed",
        figures,
        settings={
            "slowness": SLOWNESS,
            "size": f"{SIZE}×{SIZE}",
            "jobs": options.jobs,
            "pass_ms": options.pass_ms,
            "spp": options.spp,
            "slice_spp": JobSpec().slice_spp,
        },
        notes=[
            "One job at a time: where others wait, workers render for those meanwhile.",
            "Workers are simulated; Redis and monitor are real.",
        ],
    )


def measure(case: Case, pass_s: float, spp: int, jobs: int) -> list[Ended]:
    """Render one job after the other by the case's workers."""
    slowness = {f"worker-{number}": SLOWNESS for number in range(case.slow)}
    with tempfile.TemporaryDirectory() as name, _tries(second=case.second_tries):
        folder = Path(name)
        (folder / "redis").mkdir()
        with ControlPlane(folder, folder / "blobs") as plane:
            store = Blobs(str(folder / "blobs"))
            with working(plane.client, store, case.workers, pass_s, slowness) as crew:
                crew.render = Render("checks", "Gaussian", 0.4, SIZE, 0)
                ended = []
                for _ in range(jobs):
                    crew.spent.clear()
                    job = _ended(plane.jobs, spp)
                    while crew.spent.at_work:
                        time.sleep(0.05)
                    wasted = crew.spent.spp / spp - 1
                    ended.append(Ended(job.seconds, wasted, job.second_tries))
                return ended


@contextmanager
def _tries(*, second: bool) -> Iterator[None]:
    """No slice is late, where none is to be tried twice."""
    if second:
        yield
        return
    text = scripts.text().replace(_FACTOR, _FACTOR.replace("= 2,", "= 1e9,"))
    with mock.patch.object(scripts, "text", return_value=text):
        yield


def _ended(jobs: Jobs, spp: int) -> Ended:
    spec = JobSpec(rule=FixedSpec(spp=spp))
    job = jobs.create(spec, name="noise", scene_sha256="0" * 64).job
    deadline = time.monotonic() + _PATIENCE_S
    while (now := jobs.get(job.id)).finished_at is None:
        if time.monotonic() > deadline:
            raise AssertionError(f"the job has not ended: {now}")
        time.sleep(0.05)
    assert now.started_at is not None
    assert now.ended_at is not None
    seconds = (now.ended_at - now.started_at).total_seconds()
    return Ended(seconds, 0.0, now.second_tries)


if __name__ == "__main__":
    main()
