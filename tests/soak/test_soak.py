"""A farm of real parts that is used and struck for hours: it loses nothing, and nothing grows.

``make soak`` runs it for ``SOAK_MINUTES``, and writes what it found into docs/science/soak.md.
"""

import os
import time
from collections import Counter
from contextlib import ExitStack
from datetime import datetime, timezone
from pathlib import Path
from typing import Final

import pytest

from bench.support.report import Table, machine, markdown, write_report
from tests.soak.soak import Soak, adopting, leaks
from tests.soak.users import Users
from tests.support.farms.faulty_farm import FaultyFarm
from tests.support.farms.receiver import receiving
from tests.support.faults.chaos import Chaos
from tests.support.processes.ports import free_ports
from tests.support.until import until

MINUTES = float(os.environ.get("SOAK_MINUTES", "2"))
SEED = int(os.environ.get("SOAK_SEED", "1"))
#: Of faults, after which all is mended, and what is finished is compared.
ROUND_S: Final = 20.0
#: Between two faults: time for some slices.
PAUSE_S: Final = (0.3, 5.0)
#: Minutes after which growth can be told.
_LONG_ENOUGH: Final = 5.0
#: Beside an API, a monitor and a worker that are not.
STRUCK: Final = (("monitor",), ("worker",), ("worker",), ("worker",))


@pytest.mark.timeout(60 * MINUTES + 3600)
def test_nothing_is_lost_and_nothing_grows(tmp_path: Path) -> None:
    temporary, cache, data = (tmp_path / name for name in ("tmp", "cache", "farm"))
    temporary.mkdir()
    began = time.monotonic()

    def minutes() -> float:
        return (time.monotonic() - began) / 60

    def tell(line: str) -> None:
        print(f"{minutes():6.2f} min  {line}", flush=True)

    (port,) = free_ports()
    settings = {
        "TMPDIR": str(temporary),
        "PLATEAU_CHILD_TIMEOUT_S": "20",
        "PLATEAU_WEBHOOK_ALLOW": "127.0.0.1",
    }
    with ExitStack() as after:
        orphans = after.enter_context(adopting())
        receiver = after.enter_context(receiving())
        farm = after.enter_context(FaultyFarm(data, cache, plain=True, **settings))
        other_api = f"http://127.0.0.1:{port}"
        soak = after.enter_context(Soak(farm, tmp_path, other_api, receiver.url))
        # Given what becomes of each kind of job while nothing happens
        soak.render_twins()
        tell("the twins are rendered")
        # When the farm is used and struck
        struck = (*STRUCK, ("api", "--port", str(port)))
        chaos = Chaos(farm, SEED, tell, struck, PAUSE_S)
        farm.wait_for_workers(4)
        began = time.monotonic()

        def tell_growth() -> None:
            if minutes() > _LONG_ENOUGH:
                tell(f"so far\n{markdown(soak.watch.table())}")

        after.callback(tell_growth)  # a run of hours that fails has found that much
        with Users(soak.desk, SEED) as users:
            while minutes() < MINUTES:
                round_ends = time.monotonic() + ROUND_S
                while time.monotonic() < round_ends:
                    chaos.strike()
                chaos.mend(everything=True)
                # Then every job is as its twin, to the bit
                soak.compare(users.orders, chaos.damaged)
                soak.look(minutes())
                assert not users.trouble
                tell(f"{soak.compared.total()} jobs compared, {len(users.orders)} orders under way")
            lasted = minutes()
            users.is_closing = True

            def is_over() -> bool:
                chaos.mend()
                soak.compare(users.orders, chaos.damaged)
                return not users.orders

            until(is_over, 900, lambda: f"not done: {users.orders}", every_s=1)
        assert not users.trouble
        # And no more was put in vain than processes were struck
        assert soak.orphans <= sum(chaos.struck.values())
        farm.stop_all()
        # And nothing is left: no key, blob, file or process; nor has any process grown
        known = [farm.redis.process.pid, *(one.pid for one in farm.processes)]
        until(lambda: not orphans(known), 30, lambda: f"left behind: {orphans(known)}")
        left = leaks(farm.redis_client, farm.store, temporary)
    assert left == []
    assert minutes() < _LONG_ENOUGH or soak.watch.findings() == []
    about, today = machine(), datetime.now(timezone.utc).date()
    happened: Table = [
        ["", ""],
        ["date, machine", f"{today}, {about['cores']} cores, {about['cpu']}"],
        ["minutes of faults", f"{lasted:.1f}"],
        ["jobs checked", _listed(soak.compared)],
        ["faults", _listed(Counter(chaos.struck))],
        ["users' calls of the API", str(users.calls.total())],
        ["messages that a receiver got", str(len(receiver.received))],
    ]
    write_report(
        "soak",
        {"soak": happened, "soak-memory": soak.watch.table()},
        settings={"seed": SEED},
        document="soak.md",
    )


def _listed(counts: Counter[str]) -> str:
    each = ", ".join(f"{count} {kind}" for kind, count in counts.most_common())
    return f"{counts.total()}: {each}"
