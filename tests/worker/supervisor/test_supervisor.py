"""A worker renders what it leases, and nothing that happens to it is lost or counted twice."""

import hashlib
import json
import shutil
import signal
import threading
import time
from pathlib import Path

import numpy as np
import pytest
import redis

from plateau.farm.blobs import names as blobs
from plateau.farm.images.exr import decode_partial
from plateau.farm.ledger.queue import SliceQueue
from plateau.farm.ledger.workers import Workers
from plateau.farm.model.job import Job
from plateau.farm.model.seeds import SeedSchedule
from plateau.farm.model.states import JobState
from plateau.farm.process.waits import Stop
from plateau.farm.redis import keys
from plateau.worker.supervisor import child_process, supervisor
from plateau.worker.supervisor.health import Health
from plateau.worker.supervisor.kinds import Kinds
from plateau.worker.supervisor.supervisor import Supervisor
from plateau.worker.supervisor.variants import Probe, VariantChoice
from tests.support.farms.bench import SCENE, Bench, render_children, scalar, the_child
from tests.support.farms.ledger_farm import record_of
from tests.support.faults.loop_disk import LoopDisk
from tests.support.until import until


def test_it_shows_life_whether_redis_answers_or_not(bench: Bench, tmp_path: Path) -> None:
    alive = tmp_path / "alive"
    bench.settings = bench.settings.model_copy(
        update={"alive_file": alive, "redis_url": f"unix://{tmp_path}/nobody.sock"}
    )
    with bench.worker():
        until(alive.exists)
        first = alive.stat().st_mtime_ns
        until(lambda: alive.stat().st_mtime_ns > first)


def partials(bench: Bench, job: Job) -> list[str]:
    """Those of whole slices; the monitor, which there is none of here, clears the glimpse too."""
    return [name for name in bench.store.names(blobs.partials(job.id)) if "glimpse" not in name]


def test_it_renders_what_is_planned(bench: Bench) -> None:
    job, _ = bench.job(slices=3, seed=2)
    with bench.worker() as worker:
        until(lambda: len(bench.jobs.ledger(job.id)) == 3)
        living = Workers(bench.client).living
        until(lambda: [(one.id, one.slices_done) for one in living()] == [(worker.id, 3)])
    # The ledger has each slice, its seeds as the schedule has them, and who did it
    schedule = SeedSchedule("scalar_rgb", 16, 16, 5, 10_000, job_seed=2)
    for index, record in bench.jobs.ledger(job.id).items():
        assert (record["first_seed"], record["last_seed"]) == schedule.seed_range(index)
        assert (record["spp"], record["worker"]) == (5, worker.id)
        # And the partial is in the blob store, with the same in its header
        content = bench.store.get(record["blob"])
        assert hashlib.sha256(content).hexdigest() == record["sha256"]
        partial = decode_partial(content)
        assert (partial.job_id, partial.index, partial.spp) == (job.id, index, 5)
        assert partial.pixels.shape == (16, 16, 4)
        np.testing.assert_array_equal(partial.pixels[..., 3], 5)
    now = bench.jobs.get(job.id)
    assert now.core_hours == pytest.approx(2 * now.machine_s / 3600, abs=1e-9)
    assert (now.width, now.height, now.variant) == (16, 16, "scalar_rgb")
    (note,) = now.notes
    assert note.startswith("the scene's 'multijitter' sampler was replaced by 'independent': ")
    # It has signed off, and its child is gone
    assert Workers(bench.client).living() == []
    assert not render_children()


PLAIN = SCENE.format(integrator="path")
#: What is said of a scene and a spec that cannot be rendered.
BAD: dict[str, tuple[str, dict[str, object]]] = {
    "nosuchplugin": (SCENE.format(integrator="nosuchplugin"), {}),
    "wrong": (PLAIN, {"parameters": {"wrong": 1}}),
    "no sensor 3": (PLAIN, {"sensor": 3}),
    "0": (PLAIN, {"parameters": {"size": 0}}),
    "distinct seeds": (PLAIN, {"parameters": {"size": 2048}, "slice_spp": 1, "max_spp": 10_000}),
    "the rule jod judges images of 4×4 pixels or more, and this one has 3×3": (
        PLAIN,
        {"parameters": {"size": 3}, "watch": [{"name": "jod"}]},
    ),
    "nonsense": ("<scene version='3.0.0'><nonsense/></scene>", {}),
    "it is of no known kind": ("no scene at all", {}),
    "has no scene": (PLAIN + "<!-- lost -->", {}),
}


def test_bad_scenes_fail_their_jobs_in_words_and_the_next_job_runs(bench: Bench) -> None:
    bad = {said: bench.job(slices=2, scene=one, **spec)[0] for said, (one, spec) in BAD.items()}
    bench.store.delete(blobs.scene(bad["has no scene"].scene_sha256))
    with bench.worker():
        until(lambda: all(bench.jobs.get(job.id).state.ended for job in bad.values()))
        good, _ = bench.job(slices=1)
        until(lambda: len(bench.jobs.ledger(good.id)) == 1)
    for said, job in bad.items():
        failed = bench.jobs.get(job.id)
        assert failed.state is JobState.FAILED
        assert said in failed.reason
        assert str(bench.settings.cache) not in failed.reason


def test_a_worker_that_can_render_nothing_harms_no_job_and_says_so(bench: Bench) -> None:
    # Given a worker whose LLVM was there when it chose it, and is gone
    gone = "/nowhere/libLLVM.so"
    broken = VariantChoice(
        "llvm_ad_rgb", gone, "it was there", (Probe("llvm_ad_rgb", gone, ok=True, detail=""),)
    )
    job, _ = bench.job(slices=2)
    with bench.worker(broken) as worker:
        until(
            lambda: (seen := Workers(bench.client).living()) != [] and seen[0].trouble is not None
        )
        (about,) = Workers(bench.client).living()
        assert "llvm_ad_rgb renders nothing here" in str(about.trouble)
        assert about.job is None
        # Then it takes no more work, its slice counts no try, and another worker does the job
        with bench.worker() as healthy:
            until(lambda: len(bench.jobs.ledger(job.id)) == 2)
        assert {record["worker"] for record in bench.jobs.ledger(job.id).values()} == {healthy.id}
        assert worker.id != healthy.id
    assert [event for event in bench.jobs.events(job.id) if event.type == "trouble"] == []
    assert bench.jobs.get(job.id).variant == "scalar_rgb"
    # And the job's log says why the slice came back
    returned = bench.jobs.log(job.id)[0]
    assert (returned.what, returned.worker) == ("unfit", worker.id)
    assert "llvm_ad_rgb renders nothing here" in str(returned.cause)


def test_a_worker_in_which_nothing_rendered_at_its_start_takes_no_slice(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(supervisor, "_SIT_OUT_S", (0.5, 0.5))
    alive = tmp_path / "alive"
    bench.settings = bench.settings.model_copy(update={"alive_file": alive})
    why = "nothing renders here: scalar_rgb was ended by SIGILL"
    healed, trouble = threading.Event(), Health.trouble
    monkeypatch.setattr(
        Health, "trouble", lambda *asked: trouble(*asked) if healed.is_set() else why
    )
    tried = Probe("scalar_rgb", None, ok=False, detail="was ended by SIGILL")
    nothing = VariantChoice("scalar_rgb", None, why, (tried,))
    job, _ = bench.job(slices=1)
    with bench.worker(nothing):
        # Then it says so to the farm, and to the probe of its readiness
        until(lambda: [one.trouble for one in Workers(bench.client).living()] == [why])
        until(lambda: alive.exists() and alive.read_text() == why)
        assert bench.jobs.log(job.id) == []
        # And renders as soon as it can
        healed.set()
        until(lambda: len(bench.jobs.ledger(job.id)) == 1)
        until(lambda: alive.read_text() == "")


def test_a_worker_whose_bits_are_not_those_of_the_day_before_takes_no_slice(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(supervisor, "_SIT_OUT_S", (5.0, 5.0))  # some heartbeats
    # Given a worker that has rendered other bits of the known image, two days ago
    cache = bench.settings.cache
    Kinds(cache, scalar())
    file = cache / "kinds.json"
    content = json.loads(file.read_text())
    known = content["known"]["scalar_rgb"]
    known.update(bits="0123456789ab", checked=known["checked"] - 48 * 3600)
    file.write_text(json.dumps(content))
    job, _ = bench.job(slices=1)
    with bench.worker():
        # Then it says so, and its slice counts no try
        until(lambda: any(one.trouble for one in Workers(bench.client).living()))
        (about,) = Workers(bench.client).living()
        assert "scalar_rgb renders other bits of a known image" in str(about.trouble)
        until(lambda: bench.jobs.log(job.id) != [])
        assert bench.jobs.log(job.id)[0].what == "unfit"
        assert bench.jobs.ledger(job.id) == {}


def test_a_scene_that_cannot_be_fetched_for_a_while_costs_no_try(
    bench: Bench, tmp_path: Path
) -> None:
    job, _ = bench.job(slices=1)
    scene = Path(bench.store.where) / blobs.scene(job.scene_sha256)
    content = scene.read_bytes()
    scene.unlink()
    scene.symlink_to(scene)  # which cannot be read, by root neither
    with bench.worker():
        until(
            lambda: (
                (seen := Workers(bench.client).living()) != [] and seen[0].last_error is not None
            )
        )
        assert bench.jobs.get(job.id).state is not JobState.FAILED
        # Readable again in one step: a try in between would find no scene, and fail the job
        (tmp_path / "scene").write_bytes(content)
        (tmp_path / "scene").replace(scene)
        until(lambda: len(bench.jobs.ledger(job.id)) == 1)
        # What troubled it is over with the next slice that it renders
        until(lambda: [one.last_error for one in Workers(bench.client).living()] == [None])
    assert [event for event in bench.jobs.events(job.id) if event.type == "trouble"] == []


@pytest.mark.long
def test_a_cache_disk_without_room_for_a_film_costs_no_try(bench: Bench, tmp_path: Path) -> None:
    with LoopDisk(tmp_path / "disk", megabytes=16) as disk:
        bench.settings = bench.settings.model_copy(update={"cache": disk.folder / "cache"})
        # Given a worker on a disk that has room for all but a film
        ballast = disk.fill(leaving=2 << 20)
        job, _ = bench.job(slices=1, parameters={"size": 512}, slice_spp=4, step=4)
        with bench.worker() as worker:
            # When it has tried more often than a slice may cost its workers' lives
            until(lambda: len(bench.jobs.log(job.id)) > 3)
            ballast.unlink()
            # Then the job goes on as soon as there is room, and nobody has died
            until(lambda: len(bench.jobs.ledger(job.id)) == 1)
    assert [event for event in bench.jobs.events(job.id) if event.type == "trouble"] == []
    returned = bench.jobs.log(job.id)[0]
    assert (returned.what, returned.worker) == ("handed-back", worker.id)
    assert "no film can be written into" in str(returned.cause)
    assert "No space left on device" in str(returned.cause)


def test_a_cancelled_job_frees_the_worker_at_once(bench: Bench, client: redis.Redis) -> None:
    # Given slices that take minutes each, of which the first pass is to be seen
    job, _ = bench.job(slices=2, parameters={"size": 512}, slice_spp=2500, step=2500)
    with bench.worker() as worker:
        until(lambda: bench.owners.glimpse(job.id))
        bench.jobs.cancel(job.id)
        until(lambda: worker._rendering is None)
        next_job, _ = bench.job(slices=1)
        until(lambda: len(bench.jobs.ledger(next_job.id)) == 1)
    assert bench.jobs.ledger(job.id) == {}
    assert not client.exists(keys.job(job.id, "slices"))
    assert partials(bench, job) == []


class Other:
    """Another worker, which is done with each slice at once."""

    def __init__(self, bench: Bench, size: int) -> None:
        self._queue = SliceQueue(bench.client, "other", 60)
        self._size = size

    def renders(self, index: int) -> bool:
        """Whether it is given this slice, and so commits it."""
        lease = self._queue.lease(("scalar_rgb",), None, in_turn=False)
        if lease is None:
            return False
        assert lease.index == index
        record = record_of(lease, blob=f"the other's {index}", worker="other")
        size = {"width": self._size, "height": self._size}
        return self._queue.commit(lease, record, **size, notes=()) == "committed"


def test_a_worker_that_was_outrun_stops_at_its_next_pass(bench: Bench) -> None:
    # Given a worker with a slice that takes it minutes
    job, _ = bench.job(slices=2, parameters={"size": 512}, slice_spp=2500, step=2500)
    other = Other(bench, size=512)
    with bench.worker() as worker:
        until(lambda: worker._rendering is not None)
        slow = worker._rendering
        until(lambda: not worker._host.is_loading)
        # And another that is done with the next one at once, and then is given the first too
        assert other.renders(1)
        until(lambda: other.renders(0))
        # Then the slow one stops, and what it spent is counted as waste
        until(lambda: worker._rendering is not slow)
        until(lambda: bench.jobs.get(job.id).wasted_s > 0)
    assert [one["worker"] for one in bench.jobs.ledger(job.id).values()] == ["other", "other"]
    assert partials(bench, job) == []


def test_a_worker_that_is_outrun_while_it_loads_keeps_its_scene(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(child_process, "CANCEL_GRACE_S", 0.1)
    other = Other(bench, size=16)
    with bench.worker() as worker:
        # Given a child that starts, and takes its time
        until(render_children)
        child = the_child()
        child.suspend()
        job, owned = bench.job(slices=2)
        until(lambda: worker._rendering is not None)
        # When others have done its slice by then
        assert other.renders(1)
        until(lambda: other.renders(0))
        time.sleep(1.5)  # in which it would be killed
        monkeypatch.setattr(child_process, "CANCEL_GRACE_S", 60.0)
        child.resume()
        # Then it renders the next one
        bench.owners.plan(owned, range(3))
        until(lambda: len(bench.jobs.ledger(job.id)) == 3)
        assert the_child() == child
    assert bench.jobs.ledger(job.id)[2]["worker"] == worker.id


def test_a_variant_that_fails_here_costs_its_jobs_and_no_others(bench: Bench) -> None:
    gone = "/nowhere/libLLVM.so"
    tried = (*scalar().tried, Probe("llvm_ad_rgb", gone, ok=True, detail=""))
    choice = VariantChoice("scalar_rgb", gone, "asked for by the test", tried)
    broken, _ = bench.job(slices=1, variant="llvm_ad_rgb")
    with bench.worker(choice):
        until(lambda: bench.jobs.log(broken.id) != [])
        good, _ = bench.job(slices=1, variant="scalar_rgb")
        until(lambda: len(bench.jobs.ledger(good.id)) == 1)
        assert [one.trouble for one in Workers(bench.client).living()] == [None]
    assert bench.jobs.get(broken.id).state is JobState.RENDERING
    returned = bench.jobs.log(broken.id)[0]
    assert returned.what == "handed-back"
    assert "llvm_ad_rgb renders nothing here" in str(returned.cause)


def test_jobs_that_it_cannot_read_hold_it_up_for_no_time(bench: Bench) -> None:
    for _ in range(160):
        job, _ = bench.job(slices=1, variant="scalar_rgb")
        spec = bench.client.hget(keys.job(job.id), "spec")
        bench.client.hset(keys.job(job.id), "spec", spec.replace("visible", "of-another-plateau"))
    good, _ = bench.job(slices=1, variant="scalar_rgb")
    with bench.worker():
        until(lambda: len(bench.jobs.ledger(good.id)) == 1)
        until(lambda: [len(one.left_out_of) for one in Workers(bench.client).living()] == [160])


def test_a_signal_to_all_of_its_processes_harms_no_slice(bench: Bench) -> None:
    """As Slurm and systemd send it: the child hears it too, and must not die of it first."""
    job, _ = bench.job(slices=1, parameters={"size": 512}, slice_spp=4096, step=4096, max_spp=8192)
    with bench.worker() as worker:
        until(lambda: worker._rendering)
        child = the_child()
        until(lambda: child.cpu_times().user > 0.5)
        child.send_signal(signal.SIGTERM)
        worked = child.cpu_times().user
        until(lambda: child.cpu_times().user > worked + 0.2)
    (returned,) = bench.jobs.log(job.id)
    assert (returned.what, returned.cause) == ("handed-back", "the worker stops")


def test_a_worker_without_work_leaves_where_it_was_told_to(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SLURM_ARRAY_JOB_ID", "7")
    monkeypatch.setenv("SLURM_ARRAY_TASK_ID", "1")
    monkeypatch.setattr(supervisor, "DRAIN_S", 200.0)  # however slow the disk is
    job, _ = bench.job(slices=3)
    worker = Supervisor(bench.settings, scalar(), bench.store, Stop())
    thread = threading.Thread(target=worker.run)
    thread.start()
    until(lambda: Workers(bench.client).living() != [])
    assert Workers(bench.client).living()[0].label == "slurm:7_1"
    worker._settings = bench.settings.model_copy(update={"leave_after_s": 0.5})
    # It has done what there was before, and signs off
    thread.join(240)
    assert not thread.is_alive()
    assert len(bench.jobs.ledger(job.id)) == 3
    assert Workers(bench.client).living() == []


def test_a_child_is_there_before_any_scene_and_another_when_the_cache_was_cleared(
    bench: Bench,
) -> None:
    # Given a child that is shut in before any scene is there
    with bench.worker():
        until(render_children)
        early = the_child()
        until(lambda: early.num_threads() > 1)
        # Then it can open the first one
        first, _ = bench.job(slices=1)
        until(lambda: len(bench.jobs.ledger(first.id)) == 1)
        assert the_child() == early
        # If somebody clears the cache
        shutil.rmtree(bench.settings.cache / "scenes")
        # Then a new child can open what is unpacked anew
        second, _ = bench.job(slices=1)
        until(lambda: len(bench.jobs.ledger(second.id)) == 1)
        assert the_child() != early
