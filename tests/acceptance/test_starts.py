"""When a queued job starts is foretold, and so it happens."""

import time

from tests.support.farms.real_farm import RealFarm
from tests.support.until import until

#: A job of eight slices of about a second, of which it is known when it ends.
SPEC = {
    "parameters": {"width": 96, "height": 96},
    "variant": "scalar_rgb",
    "step": 200,
    "slice_spp": 50,
    "max_spp": 400,
    "rule": {"name": "fixed", "spp": 400},
}


def test_queued_jobs_start_when_they_are_expected_to(farm: RealFarm) -> None:
    farm.start("monitor")
    farm.workers(1)
    until(farm.client.workers)
    first, second, third = (farm.submit(**SPEC) for _ in range(3))
    # Given slices that tell how long the first takes
    now = until(lambda: farm.client.job(first.id).committed_spp >= 100) and farm.client.job(
        first.id
    )
    done_before = now.committed_spp // now.spec.slice_spp
    foretold = {}
    for job in (second, third):
        waits = farm.client.job(job.id)
        assert waits.state == "queued"
        # The rule says when jobs end, so it is no bound
        assert (waits.expected_start_is_bound, waits.expected_start_unknown) == (False, None)
        assert waits.expected_start_s is not None
        foretold[job.id] = time.time(), waits.expected_start_s
    assert foretold[second.id][1] < foretold[third.id][1]
    # When the time has come
    done = {job.id: farm.client.wait(job.id) for job in (first, second, third)}
    between = [part.render_s for part in farm.client.slices(first.id)[done_before:]]
    for job_id, (asked_at, foretold_s) in foretold.items():
        started_at = done[job_id].started_at
        assert started_at is not None
        took_s = started_at.timestamp() - asked_at
        # Then it was as foretold. The machine has other work, now more and now less, so that both
        # are counted in slices. Measured: within a factor of 1.5 and a slice.
        expected = foretold_s / (now.machine_s / done_before)
        took = took_s / (sum(between) / len(between))
        print(
            f"foretold {foretold_s:.1f} s, and it took {took_s:.1f} s: {expected:.1f}, {took:.1f}"
        )
        assert took / 2 - 1 <= expected <= took * 2 + 1
        assert done[job_id].expected_start_s is None
        between += [part.render_s for part in farm.client.slices(job_id)]
