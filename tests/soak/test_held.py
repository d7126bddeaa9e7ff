"""Whether a soak's judgement finds what grows, and what is left behind, and nothing else."""

import random
import subprocess
import sys
from pathlib import Path

import pytest
import redis

from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.model.spec import JobSpec
from plateau.farm.redis import keys
from tests.soak.held import MOST_COUNT, Watch
from tests.soak.soak import adopting, leaks
from tests.support.until import until

MB = 1_000_000


def _findings(own, descriptors=lambda _: 40) -> list[str]:
    """Of two hours of a process whose memory in bytes, and whose descriptors, are so by minute."""
    watch, noise = Watch(), random.Random(1)
    for minute in (place / 3 for place in range(360)):
        memory = own(minute) + noise.gauss(0, 2 * MB)
        watch.samples["monitor"].append((minute, memory, descriptors(minute), 8))
    return watch.findings()


@pytest.mark.parametrize(
    ("own", "found"),
    [
        # Caches that fill in the first half hour, peaks while a large image is judged, a restart
        (lambda minute: (100 + 2 * min(minute, 30)) * MB, 0),
        (lambda minute: (100 + 80 * (minute % 10 < 2)) * MB, 0),
        (lambda minute: (120 if minute < 70 else 90) * MB, 0),
        # A leak of 12 MB in the 80 minutes after the warm-up, among peaks; and one with restarts
        (lambda minute: 100 * MB + 150_000 * minute + 50 * MB * (minute % 10 < 2), 1),
        (lambda minute: 100 * MB + 400_000 * (minute % 60), 1),
    ],
    ids=["warm-up", "peaks", "a restart", "a leak among peaks", "a leak and a restart"],
)
def test_a_leak_of_memory_is_found_and_nothing_else(own, found):
    findings = _findings(own)
    assert len(findings) == found
    assert all(one.startswith("monitor: own memory, MB grew by") for one in findings)


def test_descriptors_that_stay_open_are_found():
    (finding,) = _findings(lambda _: 100 * MB, lambda minute: 40 + int(minute) // 4)
    assert finding.startswith("monitor: descriptors grew by 20")
    assert _findings(lambda _: 100 * MB, lambda m: 40 + int(m) % MOST_COUNT) == []


def test_a_child_that_outlives_its_parent_is_seen():
    sleeps = "import time; time.sleep(600)"
    starts = f"import subprocess, sys; subprocess.Popen([sys.executable, '-c', '{sleeps}'])"
    with adopting() as alive:
        assert alive([]) == {}
        subprocess.run([sys.executable, "-c", starts], check=True)
        ((child, command),) = alive([]).items()
        assert command.endswith(sleeps)
        assert alive([child]) == {}
        subprocess.run(["kill", "-9", str(child)], check=True)
        until(lambda: not alive([]))


def test_what_a_job_leaves_is_seen_and_what_a_farm_keeps_is_no_leak(
    client: redis.Redis, store: Blobs, tmp_path: Path
):
    made = Jobs(client).create(JobSpec(), name="box", scene_sha256="0" * 64, idempotency_key="a")
    store.put(f"jobs/{made.job.id}/partials/000000-a.exr", b"a partial")
    (tmp_path / "kernel").write_text("of a killed process")
    found = leaks(client, store, tmp_path)
    assert {
        f"Redis: {keys.job(made.job.id)}",
        f"Redis: {keys.OPEN}",
        f"blob: jobs/{made.job.id}/partials/000000-a.exr",
        "temporary file: kernel",
    } <= set(found)
    assert not [line for line in found if "idempotency" in line or keys.SCHEMA in line]
