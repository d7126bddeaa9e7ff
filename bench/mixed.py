"""How much one slow worker among fast ones delays a job: `make bench-mixed`.

Redis and the monitor are real; the workers are simulated, and one of them takes ten times as long
for a slice. Its slices delay the image, unless a second worker may render those that are late.
"""

from __future__ import annotations

import argparse
import sys
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING
from unittest import mock

from bench.support.farms.noise_workers import noise_farm, run_job
from bench.support.farms.synthetic_noise import Render
from bench.support.report import figure, write_report
from plateau.farm.model.spec import FixedSpec, JobSpec
from plateau.farm.redis import scripts

if TYPE_CHECKING:
    from collections.abc import Iterator

SIZE = 64
SLOWNESS = 10.0
_FACTOR = "LATE_FACTOR, LATE_LEAST_MS, USUAL_OF = 2,"


@dataclass(frozen=True)
class Case:
    """The workers, and whether late slices are rendered a second time."""

    name: str
    workers: int
    slow: int = 0  #: how many of them are
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
    parser.add_argument("--slice-ms", type=float, default=700, help="of a slice's rendering")
    parser.add_argument("--spp", type=int, default=600)
    parser.add_argument("--jobs", type=int, default=3)
    options = parser.parse_args()

    figures = []
    for case in CASES:
        found = measure(case, options.slice_ms / 1000, options.spp, options.jobs)
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
            "slice_ms": options.slice_ms,
            "spp": options.spp,
            "slice_spp": JobSpec().slice_spp,
        },
        notes=[
            "One job at a time; with others in the queue, workers would render those meanwhile.",
            "Workers are simulated; Redis and monitor are real.",
        ],
    )


def measure(case: Case, slice_s: float, spp: int, jobs: int) -> list[Ended]:
    """Have the case's workers render one job after the other."""
    slowness = {f"worker-{number}": SLOWNESS for number in range(case.slow)}
    ended = []
    with (
        _tries(second=case.second_tries),
        noise_farm(case.workers, slice_s / JobSpec().slice_spp, slowness) as (farm_jobs, crew),
    ):
        crew.render = Render("checks", "Gaussian", 0.4, SIZE, 0)
        for _ in range(jobs):
            one = run_job(farm_jobs, crew.spent, JobSpec(rule=FixedSpec(spp=spp)))
            ended.append(Ended(one.seconds, crew.spent.spp / spp - 1, one.job.second_tries))
    return ended


@contextmanager
def _tries(*, second: bool) -> Iterator[None]:
    """Without second tries, keep Redis from ever finding a slice late."""
    if second:
        yield
        return
    text = scripts.text().replace(_FACTOR, _FACTOR.replace("= 2,", "= 1e9,"))
    with mock.patch.object(scripts, "text", return_value=text):
        yield


if __name__ == "__main__":
    main()
