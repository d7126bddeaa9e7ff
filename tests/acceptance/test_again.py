"""An ended job, rendered on by real workers, is the job that was never stopped."""

import pytest

from tests.support.farms.faulty_farm import SPEC
from tests.support.farms.real_farm import RealFarm
from tests.support.faults.invariants import outcome
from tests.support.until import until

EARLY = {**SPEC, "rule": {"name": "fixed", "spp": 120}}


@pytest.mark.long
def test_a_job_goes_on_to_a_stricter_rule_without_losing_a_sample(farm: RealFarm) -> None:
    farm.start("monitor")
    farm.workers(2)
    undisturbed = outcome(farm, farm.submit(**SPEC).id)
    stopped = outcome(farm, farm.submit(**EARLY).id)
    assert stopped.job.spp == 120 < undisturbed.job.spp
    # When it goes on by the rule of the other, and its monitor dies on the way
    job = farm.client.again(stopped.job.id, rule=SPEC["rule"])
    until(lambda: farm.client.job(job.id).spp > 160)
    farm.kill(farm.processes[1])
    farm.start("monitor")
    done = outcome(farm, job.id)
    # Then it ends as the other did, to the bit, and rendered what was missing
    assert (done.job.state, done.job.spp) == ("converged", undisturbed.job.spp)
    assert done.image.tobytes() == undisturbed.image.tobytes()
    assert done.difference == undisturbed.difference
    counts = [
        [(point["spp"], point["visible_pixels"]) for point in one.curve]
        for one in (done, undisturbed)
    ]
    assert counts[0] == counts[1]
    rendered = [
        event.data["index"] for event in farm.client.happened(job.id) if event.type == "slice"
    ]
    assert min(rendered) == 120 // SPEC["slice_spp"]
    # The old job is as it was
    assert outcome(farm, stopped.job.id).image.tobytes() == stopped.image.tobytes()
