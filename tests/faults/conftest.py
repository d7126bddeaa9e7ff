"""Fault tests share one farm: Redis, API and blobs stay, and each test starts what it harms."""

import os
import pickle
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.support.farms.faulty_farm import BRIEF, FaultyFarm
from tests.support.faults.invariants import Outcome, outcome


@pytest.fixture(scope="session")
def shared_farm(tmp_path_factory: pytest.TempPathFactory, cache: Path) -> Iterator[FaultyFarm]:
    with FaultyFarm(tmp_path_factory.mktemp("farm"), cache) as farm:
        yield farm


@pytest.fixture
def farm(shared_farm: FaultyFarm) -> Iterator[FaultyFarm]:
    """The shared farm, with nothing but its API running before and after."""
    shared_farm.stop_all()  # what one file's tests have kept for each other
    yield shared_farm
    shared_farm.stop_all()


@pytest.fixture(scope="session")
def undisturbed(shared_farm: FaultyFarm) -> Outcome:
    """What comes of the job where nothing happens, on any farm."""
    kept = Path(os.environ["TESTS_TEMPORARY"], "undisturbed")  # for all processes of ``-n``
    if kept.exists():
        return pickle.loads(kept.read_bytes())
    shared_farm.start("monitor")
    shared_farm.start("worker")
    job = shared_farm.submit(**BRIEF)
    found = outcome(shared_farm, job.id)
    shared_farm.stop_all()
    assert found.job.state == "converged"
    mine = kept.with_suffix(f".{os.getpid()}")
    mine.write_bytes(pickle.dumps(found))
    mine.replace(kept)
    return found


@pytest.fixture
def submit(farm: FaultyFarm) -> Callable[[], str]:
    """Submits the job that `undisturbed` was, and returns its id."""
    return lambda: farm.submit(**BRIEF).id
