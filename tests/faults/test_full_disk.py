"""A service whose data folder is on a full disk: Redis stops, and goes on when there is room."""

from pathlib import Path

import pytest

from plateau.client import Client
from plateau.farm.images.exr import decode_image
from plateau.farm.model.spec import JobSpec
from tests.support import FRAMES
from tests.support.farms.faulty_farm import BRIEF
from tests.support.farms.real_farm import BOX
from tests.support.faults.invariants import Outcome
from tests.support.faults.loop_disk import LoopDisk
from tests.support.processes.commands import Command
from tests.support.until import until

READY = r"listens at (http://127\.0\.0\.1:\d+)"


@pytest.mark.long
def test_redis_stops_and_goes_on_when_there_is_room(
    tmp_path: Path, cache: Path, undisturbed: Outcome
) -> None:
    with LoopDisk(tmp_path / "disk", megabytes=24) as disk:
        settings = {"PLATEAU_CACHE": str(cache), "PLATEAU_LEASE_S": "2"}
        data = str(disk.folder / "data")
        with Command("up", "--port", "0", folder=tmp_path, PLATEAU_DATA=data, **settings) as up:
            with Client(up.wait_for(READY)) as client:
                job = client.submit(BOX, JobSpec.model_validate(FRAMES | BRIEF)).id
                until(lambda: client.job(job).points >= 3, 120)
                # Given a disk without room for one more write of Redis's
                disk.fill()
                up.wait_for("Redis exited with 1; starting it again")
                assert up.process.poll() is None
                # When there is room
                disk.free()
                # Then the job goes on to the same end
                done = client.wait(job)
                assert (done.state, done.spp) == (undisturbed.job.state, undisturbed.job.spp)
                image = decode_image(client.image(job, "image.exr"))
                assert image.tobytes() == undisturbed.image.tobytes()
            up.process.terminate()
            assert up.exit_code() == 0
            up.is_gone()
