"""The uploader delivers what was rendered, and keeps no worker from stopping."""

import threading
import time
from datetime import timedelta

import numpy as np
import pytest
import redis

from plateau.farm.blobs.bucket import TIMES
from plateau.farm.blobs.store import Blobs
from plateau.farm.images.exr import decode_partial
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.ownership import Ownerships
from plateau.farm.ledger.queue import Lease, SliceQueue
from plateau.worker.renderers.contract import Loaded
from plateau.worker.supervisor.uploader import Glimpse, Rendered, Uploader
from tests.support.farms.ledger_farm import lease_scalar
from tests.support.farms.staged_job import HEIGHT, WIDTH, StagedJob
from tests.support.faults.odd_s3 import OddS3
from tests.support.until import until


def rendered(lease: Lease) -> Rendered:
    return Rendered(
        lease=lease,
        scene=Loaded(width=WIDTH, height=HEIGHT),
        film=np.ones((HEIGHT, WIDTH, 4), np.float32),
        first_seed=lease.index * 100,
        last_seed=lease.index * 100 + 99,
        render_s=0.5,
        said="",
    )


def test_what_waits_is_committed_before_the_worker_stops(client: redis.Redis, store: Blobs) -> None:
    job, queue = StagedJob(client), SliceQueue(client, "worker-1", lease_s=60)
    uploader = Uploader(store, queue, "worker-1")
    for _ in range(3):
        job.plan()
        assert uploader.submit(rendered(lease_scalar(queue)), threading.Event())
    uploader.close(200)
    ledger = Jobs(client).ledger(job.id)
    assert sorted(ledger) == [0, 1, 2]
    assert sorted(store.names("")) == sorted(one["blob"] for one in ledger.values())
    assert uploader.leases == ()


def test_a_glimpse_is_there_for_the_monitor_unless_it_comes_too_late(
    client: redis.Redis, store: Blobs
) -> None:
    job, queue = StagedJob(client), SliceQueue(client, "worker-1", lease_s=60)
    job.plan()
    lease = lease_scalar(queue)
    names, quotients = ("R", "G", "B", "W", "light", "colour"), (("light", "colour"),)
    film = np.ones((HEIGHT, WIDTH, 6), np.float32)
    scene = Loaded(width=WIDTH, height=HEIGHT, channels=names, quotients=quotients)
    glimpse = Glimpse(lease=lease, scene=scene, film=film, spp=4, first_seed=7)
    uploader = Uploader(store, queue, "worker-1")
    uploader.show(glimpse)
    owners = Ownerships(client, lease_s=60)
    until(lambda: owners.glimpse(job.id) is not None)
    (name,) = store.names("")
    assert owners.glimpse(job.id) == name
    partial = decode_partial(store.get(name))
    assert (partial.spp, partial.first_seed, partial.last_seed) == (4, 7, 7)
    np.testing.assert_array_equal(partial.pixels, film)
    assert (partial.channels.names, partial.channels.quotients) == (names, quotients)
    # Given that its monitor has shown it
    store.delete(name)
    job.picture(store, "image.png", b"a picture")
    (picture,) = store.names("")
    # Then another is not kept, as after a second try of the slice
    uploader.show(glimpse)
    uploader.close(200)
    assert store.names("") == [picture]


def test_a_silent_store_holds_up_no_worker_that_stops(
    client: redis.Redis, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("AWS_ACCESS_KEY_ID", "anna")
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "secret")
    monkeypatch.setitem(TIMES, "read_timeout", timedelta(minutes=10))
    with OddS3() as server:
        monkeypatch.setenv("AWS_ENDPOINT_URL_S3", server.endpoint)
        job, queue = StagedJob(client), SliceQueue(client, "worker-1", lease_s=60)
        uploader = Uploader(Blobs("s3://bucket"), queue, "worker-1")
        # Given slices that were rendered, and a store that does not answer
        server.silent.set()
        for _ in range(3):
            job.plan()
            assert uploader.submit(rendered(lease_scalar(queue)), threading.Event())
        # When the worker is to stop
        started = time.monotonic()
        uploader.close(0.5)
        # Then it does not wait until the store is given up, and others can have the slices
        assert time.monotonic() - started < 300
        other = SliceQueue(client, "worker-2", lease_s=60)
        assert sorted(lease_scalar(other).index for _ in range(3)) == [0, 1, 2]
        # And should one of them arrive after all, it counts once
        server.silent.clear()
        until(lambda: all(one.name != "uploader" for one in threading.enumerate()))
        assert len(Jobs(client).ledger(job.id)) <= 1
