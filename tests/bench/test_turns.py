"""Process trees that run in turns, and the farm and the bare renderer as two of them."""

import sys
from itertools import pairwise

import psutil
import pytest

from bench import farm
from bench.support.alone import Case
from bench.support.processes import take_turns
from plateau.farm.process.settings import Settings
from plateau.scenes import FOLDER
from plateau.worker.supervisor.variants import choose

#: It begins once it was stopped and goes on.
_SPIN = """import signal, time
signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGCONT})
signal.sigwait({signal.SIGCONT})
while time.process_time() < 1.5: pass"""
_SPIN_BELOW = f"import subprocess, sys\nsubprocess.run([sys.executable, '-c', {_SPIN!r}])"


def _python(program: str) -> psutil.Popen:
    return psutil.Popen([sys.executable, "-c", program])


def test_a_tree_has_its_turns_and_nothing_beside() -> None:
    ran = take_turns({"one": _python(_SPIN), "below": _python(_SPIN_BELOW)}, turn_s=0.05)
    for one in ran.values():
        assert len(one.turns) > 3
        # One thread spins, and only in its turns
        assert 1.5 <= one.cpu_s < one.own_s() + 0.5
    turns = sorted(turn for one in ran.values() for turn in one.turns)
    assert all(end <= start for (_, end), (start, _) in pairwise(turns))


def test_where_one_fails_none_is_left() -> None:
    long = _python("import time; time.sleep(600)")
    with pytest.raises(ChildProcessError, match="short: exit code 3"):
        take_turns({"long": long, "short": _python("raise SystemExit(3)")}, turn_s=0.1)
    assert not psutil.pid_exists(long.pid)


@pytest.mark.timeout(600)
@pytest.mark.long
def test_the_farm_is_compared_with_mitsuba_alone() -> None:
    choice = choose(Settings().cache)
    case = Case(scene=FOLDER / "box", width=32, height=24, choice=choice, threads=1)
    effort = farm.Effort(pairs=1, seconds=0.1, step=50, rounds=1, samples=2**16, turn_s=0.05)
    head, row = farm.measure(case, effort)["farm"]
    found = dict(zip(head, row, strict=True))
    spp = int(found[""].removeprefix("box 32×24, ").removesuffix(" spp"))
    assert spp >= 200
    assert spp % 50 == 0
    assert found["pairs of runs"] == "1"
    assert int(found["spp of a bare call"]) > 0
    value = {name: float(found[name].split()[0]) for name in head[head.index("efficiency") :]}
    assert value["efficiency"] > 0
    assert value["from start to results"] > 0
    assert value["CPU time of a sample"] > 0
    assert 0 <= value["the monitor's share"] < 1
