"""A test that never ends, for `tests/test_own_processes.py`, which kills its pytest."""

import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from plateau.farm.redis.embedded import EmbeddedRedis
from tests.support.processes.mitsuba_process import MitsubaProcess


def test_that_runs_on(embedded_redis: EmbeddedRedis) -> None:
    # Given processes of each kind: a Redis, a daemon, a thread's, a pool's
    subprocess.run(["sh", "-c", "sleep 601 &"], check=True)
    sleeper = [sys.executable, "-c", "import time; time.sleep(600)"]
    with ThreadPoolExecutor(1) as pool:
        started = pool.submit(subprocess.Popen, sleeper).result()
    with MitsubaProcess("scalar_rgb") as mitsuba:
        assert mitsuba.call(os.getpid) != os.getpid()
        assert started.poll() is None
        Path(os.environ["PLATEAU_TEST_IS_READY"]).touch()
        time.sleep(600)
