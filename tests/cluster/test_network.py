"""Networks that fail: whatever they lose, and for however long, a job comes to the same end."""

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.cluster.support_network import Network
from tests.cluster.support_network_farm import (
    HOSTS,
    MONITOR,
    REDIS,
    SPEC,
    WORKERS,
    NetworkFarm,
    cases,
)
from tests.support.faults.invariants import Outcome, assert_same, outcome
from tests.support.until import until

FIRST = WORKERS[0]
#: A lease of this farm lasts 6 s: time for a second try on another connection.
LONGER_THAN_A_LEASE_S = 8.0


@pytest.fixture(scope="module")
def network(tool: Callable[[str], Path]) -> Iterator[Network]:
    with Network(tool, *HOSTS) as network:
        yield network


@pytest.fixture(scope="module")
def shared_farm(
    network: Network, tmp_path_factory: pytest.TempPathFactory, cache: Path
) -> Iterator[NetworkFarm]:
    folder = tmp_path_factory.mktemp("farm")
    with NetworkFarm(network, folder, cache, PLATEAU_LEASE_S="6") as farm:
        farm.start_all()
        yield farm
        network.heal()


@pytest.fixture(scope="module")
def undisturbed(shared_farm: NetworkFarm) -> Outcome:
    """What comes of the job where nothing happens."""
    found = outcome(shared_farm, shared_farm.submit(**SPEC).id)
    assert found.job.state == "converged"
    return found


@pytest.fixture
def farm(shared_farm: NetworkFarm) -> Iterator[NetworkFarm]:
    """The farm with all of its processes, which live through every fault."""
    yield shared_farm
    shared_farm.network.heal()
    assert all(process.poll() is None for process in shared_farm.processes)


def under_way(farm: NetworkFarm) -> str:
    """Submit the job and wait until it is in the middle of its work."""
    job = farm.submit(**SPEC).id
    until(lambda: farm.jobs.get(job).points >= 2)
    return job


def loses_packets(network: Network) -> None:
    for host in HOSTS:
        network.lose(host, 0.163)  # on both of its links a packet is lost with 30 %


#: What happens to the network, in words.
FAULTS: dict[str, Callable[[Network], object]] = {
    "a worker is cut off": lambda network: network.cut(FIRST),
    "a worker hears nothing": lambda network: network.cut_to(FIRST),
    "a worker is not heard": lambda network: network.cut_from(FIRST),
    "the monitor is cut off": lambda network: network.cut(MONITOR),
    "the monitor hears nothing": lambda network: network.cut_to(MONITOR),
    "the monitor is not heard": lambda network: network.cut_from(MONITOR),
    "Redis is cut off": lambda network: network.cut(REDIS),
    "Redis hears nothing": lambda network: network.cut_to(REDIS),
    "Redis is not heard": lambda network: network.cut_from(REDIS),
    "30 % of all packets are lost": loses_packets,
}
SHORT = ("a worker is cut off", "the monitor hears nothing", "30 % of all packets are lost")


@pytest.mark.parametrize("fault", cases(FAULTS, SHORT))
def test_it_fails_for_longer_than_a_lease(
    farm: NetworkFarm, undisturbed: Outcome, fault: str
) -> None:
    job = under_way(farm)
    FAULTS[fault](farm.network)
    time.sleep(LONGER_THAN_A_LEASE_S)
    farm.network.heal()
    assert_same(outcome(farm, job), undisturbed)


@pytest.mark.long_form
@pytest.mark.parametrize("host", [FIRST, MONITOR, REDIS])
def test_connections_that_are_forgotten_on_the_way_cost_no_lease(
    farm: NetworkFarm, undisturbed: Outcome, host: str
) -> None:
    job = under_way(farm)
    assert farm.network.forget_connections(host) > 0
    assert_same(outcome(farm, job), undisturbed)
    assert [one for one in farm.jobs.events(job) if one.type == "trouble"] == []


@pytest.mark.long_form
def test_who_watches_a_job_sees_its_end_through_it_all(
    farm: NetworkFarm, undisturbed: Outcome
) -> None:
    farm.start_on(MONITOR, "api", "--port", "8713")
    plateau = (*farm.network.on(MONITOR), sys.executable, "-m", "plateau")
    until(lambda: subprocess.run((*plateau, "list"), capture_output=True).returncode == 0)
    job = under_way(farm)
    command = (*plateau, "watch", job)
    watching = subprocess.Popen(command, text=True, stdout=subprocess.PIPE)
    until(lambda: any(one["cmd"] == "xread" for one in farm.redis_client.client_list()))
    for fault in ("the monitor is cut off", "Redis is not heard"):
        FAULTS[fault](farm.network)
        time.sleep(LONGER_THAN_A_LEASE_S)
        farm.network.heal()
    said, _ = watching.communicate(timeout=120)
    assert watching.returncode == 0
    assert "converged" in said
    assert_same(outcome(farm, job), undisturbed)
