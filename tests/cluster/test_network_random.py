"""Networks that fail at random: whatever happens, every job comes out as if nothing had.

``NETWORK_SEED`` and ``NETWORK_MINUTES`` set the seed and the time; both are printed.
"""

import os
import random
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

import pytest

from plateau.farm.sweep import sweep
from tests.cluster.support_network import Network
from tests.cluster.support_network_farm import MONITOR, REDIS, SPEC, WORKERS, NetworkFarm
from tests.support.faults.invariants import assert_same, outcome
from tests.support.until import until

pytestmark = pytest.mark.long_form

SEED = int(os.environ.get("NETWORK_SEED", "1"))
MINUTES = float(os.environ.get("NETWORK_MINUTES", "1.5"))
JOBS = 2  #: under way at once
MOST_AILING = 2  #: hosts at once
_PAUSE_S: Final = (0.1, 1.5)  #: between two faults
_LONGEST_S: Final = 8.0  #: of a fault; a lease of this farm lasts 2 s

FAULTS: Final[tuple[tuple[int, str, Callable[[Network, str], object]], ...]] = (
    (3, "cut off", Network.cut),
    (2, "not heard", Network.cut_from),
    (2, "hears nothing", Network.cut_to),
    (3, "loses 30 %", lambda network, host: network.lose(host, 0.3)),
    (2, "its connections are forgotten", Network.forget_connections),
)


def test_a_year_in_the_life_of_a_network(
    tool: Callable[[str], Path], tmp_path: Path, cache: Path
) -> None:
    print(f"NETWORK_SEED={SEED} NETWORK_MINUTES={MINUTES:g}")
    dice = random.Random(SEED)
    hosts = (REDIS, MONITOR, *WORKERS)
    with Network(tool, *hosts) as network, NetworkFarm(network, tmp_path, cache) as farm:
        farm.start_all()
        first = farm.submit(**SPEC)
        undisturbed = outcome(farm, first.id)
        ends = time.monotonic() + 60 * MINUTES
        jobs: list[str] = []
        ailing: dict[str, float] = {}  # until when
        struck = 0
        while time.monotonic() < ends:
            time.sleep(dice.uniform(*_PAUSE_S))
            for host in [host for host, until_s in ailing.items() if until_s < time.monotonic()]:
                network.heal(host)
                del ailing[host]
            if len([one for one in jobs if not farm.jobs.get(one).state.ended]) < JOBS:
                jobs.append(farm.submit(**SPEC).id)
            well = [host for host in network.hosts if host not in ailing]
            if len(ailing) < MOST_AILING:
                host = dice.choice(well)
                _, name, strike = dice.choices(FAULTS, [weight for weight, *_ in FAULTS])[0]
                lasts_s = dice.uniform(0, _LONGEST_S)
                print(f"{ends - time.monotonic():6.1f} s left: {host}: {name} for {lasts_s:.1f} s")
                strike(network, host)
                ailing[host] = time.monotonic() + lasts_s
                struck += 1
        # When all is well again
        network.heal()
        until(lambda: all(farm.jobs.get(job).finished_at is not None for job in jobs), 240)
        swept = sweep(farm.redis_client, farm.store)
        print(f"{len(jobs)} jobs, {struck} faults, swept {swept.orphans} orphans")
        # Then every job comes to the same end, and no process has died
        for job in jobs:
            assert_same(outcome(farm, job), undisturbed)
        assert all(process.poll() is None for process in farm.processes)
        assert struck > 10 * MINUTES
        farm.stop_all()
