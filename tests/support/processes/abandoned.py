"""A test that never ends, for `tests/test_own_processes.py`, which kills its pytest."""

import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from plateau.farm.redis.embedded import EmbeddedRedis
from tests.support.processes.commands import Command
from tests.support.processes.mitsuba_process import MitsubaProcess


def test_a_farm_runs_on(tmp_path: Path, embedded_redis: EmbeddedRedis) -> None:
    # Given processes of each kind: a service, a Redis, a daemon, a thread's, a pool's
    subprocess.run(["sh", "-c", "sleep 601 &"], check=True)
    up = Command("up", "--workers", "1", "--port", "0", folder=tmp_path)
    sleeper = [sys.executable, "-c", "import time; time.sleep(600)"]
    with ThreadPoolExecutor(1) as pool:
        started = pool.submit(subprocess.Popen, sleeper).result()
    with MitsubaProcess("scalar_rgb") as mitsuba:
        assert mitsuba.call(os.getpid) != os.getpid()
        up.wait_for(r"http://\S+")
        assert started.poll() is None
        Path(os.environ["PLATEAU_TEST_IS_READY"]).touch()
        time.sleep(600)
