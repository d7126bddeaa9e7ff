"""Process trees that run in turns, and the farm and the bare renderer as two of them."""

import sys
import time
from dataclasses import asdict
from itertools import pairwise
from pathlib import Path

import psutil
import pytest

from bench import farm
from bench.support.farms.plateau_render import Watch
from bench.support.report import machine
from bench.support.turns import Ran, take_turns
from plateau.farm.process.settings import Settings
from plateau.worker.supervisor.variants import choose

_SPIN = "import time\nwhile time.process_time() < 0.6: pass"
_SPIN_BELOW = f"import subprocess, sys\nsubprocess.run([sys.executable, '-c', {_SPIN!r}])"


def _python(program: str) -> psutil.Popen:
    return psutil.Popen([sys.executable, "-c", program])


def test_a_tree_has_its_turns_and_nothing_beside() -> None:
    ran = take_turns({"one": _python(_SPIN), "below": _python(_SPIN_BELOW)}, turn_s=0.1)
    for one in ran.values():
        assert len(one.turns) > 3
        # One thread spins, and only in its turns
        assert 0.6 <= one.cpu_s < one.own_s() + 0.1
    turns = sorted(turn for one in ran.values() for turn in one.turns)
    assert all(end <= start for (_, end), (start, _) in pairwise(turns))


def test_own_time_goes_on_in_turns_only() -> None:
    ran = Ran(turns=[(10.0, 11.0), (15.0, 16.0)])
    assert [ran.own_s(at) for at in (9, 10.5, 13, 15.5, 20)] == [0, 0.5, 1, 1.5, 2]
    assert ran.own_s() == 2


def test_where_one_fails_none_is_left() -> None:
    long = _python("import time; time.sleep(600)")
    with pytest.raises(ChildProcessError, match="short: exit code 3"):
        take_turns({"long": long, "short": _python("raise SystemExit(3)")}, turn_s=0.1)
    assert not psutil.pid_exists(long.pid)


def test_who_has_ended_counts_with_what_it_had_used() -> None:
    spins = [[sys.executable, "-c", _SPIN, name] for name in ("worker", "monitor")]
    root = _python(f"import subprocess\nfor one in {spins}: subprocess.run(one)")
    watch, began = Watch(root), time.time()
    while root.poll() is None:
        watch.look()
        time.sleep(0.01)
    assert 0.35 < watch.monitors_share(began, time.time()) < 0.65


@pytest.mark.timeout(600)
def test_the_farm_is_compared_with_mitsuba_alone() -> None:
    box = Path(farm.__file__).parents[1] / "scenes" / "box"
    choice = choose(Settings().cache)
    work = farm.Work(scene=box, width=32, height=24, spp=200, step=50, choice=choice, threads=1)
    figures = farm.measure(work, pairs=1, turn_s=0.05)
    value = {one.name.removeprefix("box 32×24: "): one.value for one in figures}
    assert value[farm.EFFICIENCY] > 0
    assert value[farm.CPU] > 1
    assert 0 <= value[farm.MONITOR] < 1
    shown = farm.tables(
        {
            "machine": machine(),
            "settings": {
                "cases": {work.name: {"spp": 200, "step": 50}},
                "variant": choice.variant,
                "workers": 1,
                "threads": 1,
            },
            "figures": [asdict(one) for one in figures],
        }
    )
    assert "| box 32×24, 200 spp, step 50 | 1 |" in shown["farm"]
