"""A farm of real parts that is used and struck for hours: it loses nothing, and nothing grows.

``make soak`` runs it for ``SOAK_MINUTES``, and writes what it found into docs/science/soak.md.
"""

import os
import socket
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Final

import pytest

from tests.soak.report import Found, write
from tests.soak.soak import Soak, adopting, leaks
from tests.soak.users import Users
from tests.support.farms.faulty_farm import FaultyFarm
from tests.support.farms.receiver import receiving
from tests.support.faults.chaos import Chaos
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


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port: int = server.getsockname()[1]
        return port


@pytest.mark.timeout(60 * MINUTES + 3600)
def test_nothing_is_lost_and_nothing_grows(tmp_path: Path) -> None:
    temporary, cache, data = (tmp_path / name for name in ("tmp", "cache", "farm"))
    temporary.mkdir()
    began = time.monotonic()

    def minutes() -> float:
        return (time.monotonic() - began) / 60

    def tell(line: str) -> None:
        print(f"{minutes():6.2f} min  {line}", flush=True)

    port = free_port()
    settings = {
        "TMPDIR": str(temporary),
        "PLATEAU_CHILD_TIMEOUT_S": "20",
        "PLATEAU_WEBHOOK_ALLOW": "127.0.0.1",
    }
    with ExitStack() as after:
        orphans = after.enter_context(adopting())
        receiver = after.enter_context(receiving())
        farm = after.enter_context(FaultyFarm(data, cache, **settings))
        soak = Soak(farm, tmp_path, f"http://127.0.0.1:{port}", receiver.url)
        after.callback(soak.close)
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
                tell(f"so far {soak.watch.in_words()}")

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
    assert [*left, *soak.watch.findings()] == []
    write(
        Found(
            minutes=lasted,
            seed=SEED,
            compared=soak.compared,
            cancelled=soak.cancelled,
            struck=chaos.struck,
            calls=users.calls.total(),
            messages=len(receiver.received),
            orphans=soak.orphans,
            watch=soak.watch,
        )
    )
