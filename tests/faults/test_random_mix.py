"""Faults of all kinds at random, and every job comes out as if nothing had happened.

``FAULT_SEED`` and ``FAULT_MINUTES`` set the seed and the time; both are printed.
"""

import os
import time
from pathlib import Path

import pytest

from plateau.farm.sweep import sweep
from tests.support.farms.faulty_farm import BRIEF, FaultyFarm
from tests.support.faults.chaos import MEMBERS, Chaos
from tests.support.faults.invariants import Outcome, assert_same, outcome
from tests.support.long_tests import rare
from tests.support.until import until

SEED = int(os.environ.get("FAULT_SEED", "1"))
MINUTES = float(os.environ.get("FAULT_MINUTES", "0.3"))


@pytest.mark.timeout(60 * MINUTES + 300)
@pytest.mark.parametrize(
    ("members", "jobs_at_once", "faults", "minutes"),
    [(MEMBERS[1:4], 1, 6, 0.0), *rare((MEMBERS, 3, 0, MINUTES))],
    ids=["short", "long"],
)
def test_a_year_in_the_life_of_a_farm(
    tmp_path_factory: pytest.TempPathFactory,
    cache: Path,
    undisturbed: Outcome,
    members: tuple[tuple[str, ...], ...],
    jobs_at_once: int,
    faults: int,
    minutes: float,
) -> None:
    print(f"FAULT_SEED={SEED} FAULT_MINUTES={minutes:g}")
    limits = {"PLATEAU_CHILD_TIMEOUT_S": "10"}
    with FaultyFarm(tmp_path_factory.mktemp("year"), cache, **limits) as farm:
        started = time.monotonic()

        def tell(line: str) -> None:
            print(f"{time.monotonic() - started:6.1f} s  {line}")

        jobs = [farm.submit(**BRIEF).id for _ in range(jobs_at_once)]
        chaos = Chaos(farm, SEED, tell, members)
        farm.wait_for_workers(sum(role == "worker" for (role,) in members))
        while time.monotonic() < started + 60 * minutes or sum(chaos.struck.values()) < faults:
            chaos.strike()
            if chaos.redis_is_away:
                continue
            under_way = [job for job in jobs if not farm.jobs.get(job).state.ended]
            if len(under_way) < jobs_at_once:
                first = farm.jobs.get(jobs[0])
                again = farm.jobs.create(
                    first.spec, name=first.name, scene_sha256=first.scene_sha256
                )
                jobs.append(again.job.id)
        # When all is well again
        chaos.mend(everything=True)

        def is_over() -> bool:
            chaos.mend()
            return all(farm.jobs.get(job).finished_at is not None for job in jobs)

        until(is_over, 240)
        # And swept of what was put by processes that were killed before they could commit it
        swept = sweep(farm.redis_client, farm.store)
        tell(f"swept: {swept}")
        assert swept.orphans <= sum(chaos.struck.values())
        # Then every job comes to the end that it has where nothing happens, by the same curve,
        # with the same image
        for job in jobs:
            assert_same(outcome(farm, job, damaged=chaos.damaged), undisturbed)
        tell(f"{len(jobs)} jobs; {chaos.struck}")
        assert sum(chaos.struck.values()) > 10 * minutes
        farm.stop_all()  # those also that have just begun anew
