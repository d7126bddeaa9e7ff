"""Whether a soak sees what is left behind."""

import subprocess
import sys
from pathlib import Path

import redis

from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.model.spec import JobSpec
from plateau.farm.redis import keys
from tests.soak.soak import adopting, leaks
from tests.support.until import until

#: A process that starts another, which outlives it.
_PARENT = """
import subprocess, sys
child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
print(child.pid, flush=True)
child.wait()
"""


def test_a_child_that_outlives_its_parent_is_seen() -> None:
    with adopting() as alive:
        assert alive([]) == []
        with subprocess.Popen([sys.executable, "-c", _PARENT], stdout=subprocess.PIPE) as parent:
            assert parent.stdout is not None
            child = int(parent.stdout.readline())
            assert alive([parent.pid]) == []
            parent.kill()
        (left,) = until(lambda: alive([]))
        assert left.endswith("time.sleep(600)")
        assert alive([child]) == []
        subprocess.run(["kill", "-9", str(child)], check=True)
        until(lambda: not alive([]))


def test_what_a_job_leaves_is_seen_and_what_a_farm_keeps_is_no_leak(
    client: redis.Redis, store: Blobs, tmp_path: Path
) -> None:
    temporary = tmp_path / "tmp"
    temporary.mkdir()
    made = Jobs(client).create(JobSpec(), name="box", scene_sha256="0" * 64, idempotency_key="a")
    store.put(f"jobs/{made.job.id}/partials/000000-a.exr", b"a partial")
    (temporary / "kernel").write_text("of a killed process")
    found = leaks(client, store, temporary)
    assert {
        f"Redis: {keys.job(made.job.id)}",
        f"Redis: {keys.OPEN}",
        f"blob: jobs/{made.job.id}/partials/000000-a.exr",
        "temporary file: kernel",
    } <= set(found)
    assert not [line for line in found if "idempotency" in line or keys.SCHEMA in line]
