"""What was stored before films had named channels is shown and continued, or refused in words."""

import hashlib
import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest
import redis

from plateau.farm.blobs import store as blobs
from plateau.farm.images.exr import decode_layers, decode_partial, encode_image
from plateau.farm.ledger.ownership import Checkpoint, checkpoint_of
from plateau.farm.model.job import Job
from plateau.farm.model.states import JobState
from plateau.farm.redis import keys
from plateau.service.api.points.remaking import remade
from tests.service.api.routes.test_again import go_on, loses
from tests.support.farms.noise_farm import NoiseFarm

JOB = {"step": 20, "slice_spp": 10, "max_spp": 80, "rule": {"name": "fixed", "spp": 40}}


@pytest.fixture
def farm(client: redis.Redis, redis_url: str, tmp_path: Path) -> NoiseFarm:
    return NoiseFarm(client, redis_url, tmp_path)


def finished(farm: NoiseFarm, **spec: object) -> Job:
    job = farm.submit(**{**JOB, **spec})
    with farm.monitor():
        return farm.finish(job)


def continued(farm: NoiseFarm, job: Job, **changes: Any) -> Job:
    with farm.monitor():
        return farm.finish(go_on(farm, job, **changes))


def age_sums(farm: NoiseFarm, job: Job) -> None:
    """Make the job's last checkpoint one from before films had other channels."""
    client = farm.jobs._redis
    known = checkpoint_of(client, job.id)
    assert known is not None
    with np.load(io.BytesIO(farm.store.get(known.blob))) as file:
        arrays = {name: file[name] for name in file.files}
    about = json.loads(str(arrays.pop("about")))
    del about["film"]
    stream = io.BytesIO()
    np.savez(stream, about=np.array(json.dumps(about)), **arrays)
    farm.store.put(known.blob, stream.getvalue())
    digest = hashlib.sha256(stream.getvalue()).hexdigest()
    old = Checkpoint(blob=known.blob, sha256=digest, slices=known.slices)
    client.hset(keys.job(job.id), "checkpoint", old.model_dump_json())


def age_partial(content: bytes) -> bytes:
    """A partial, as a Plateau wrote it that knew no other channels than R, G, B and W."""
    new = ("plateau:channels", "plateau:ids", "plateau:renderer")
    with OpenEXR.File(io.BytesIO(content), separate_channels=True) as file:
        header = {name: value for name, value in file.header().items() if name not in new}
        header.pop("channels")
        planes = {name: one.pixels for name, one in file.channels().items()}
    stream = io.BytesIO()
    with OpenEXR.File(header, planes) as file:
        file.write(stream)
    return stream.getvalue()


def age_slices(farm: NoiseFarm, job: Job) -> None:
    ledger = keys.job(job.id, "ledger")
    for index, text in farm.jobs._redis.hgetall(ledger).items():
        stored = json.loads(text)
        record = json.loads(stored["record"])
        content = age_partial(farm.store.get(record["blob"]))
        farm.store.put(record["blob"], content)
        record["sha256"] = hashlib.sha256(content).hexdigest()
        stored["record"] = json.dumps(record)
        farm.jobs._redis.hset(ledger, index, json.dumps(stored))


def test_old_sums_are_continued_to_the_same_image(farm: NoiseFarm) -> None:
    never_stopped = finished(farm, rule={"name": "fixed", "spp": 80})
    stopped = finished(farm)
    age_sums(farm, stopped)
    done = continued(farm, stopped, rule={"name": "fixed", "spp": 80})
    assert (done.state, done.spp) == (JobState.CONVERGED, 80)
    one, other = (decode_layers(farm.picture(job, "image.exr")) for job in (never_stopped, done))
    assert one.keys() == other.keys() == {"R", "G", "B"}
    assert all(np.array_equal(one[name], other[name]) for name in one)
    # Of samples whose origin is not known, it says nothing
    with OpenEXR.File(io.BytesIO(farm.picture(done, "image.exr"))) as file:
        assert "plateau:first_seed" not in file.header()
        assert file.header()["plateau:spp"] == 80


def test_old_slices_are_judged_again(farm: NoiseFarm) -> None:
    kept = finished(farm, keep_slices=True)
    before = farm.picture(kept, "image.exr")
    content = farm.store.get(farm.jobs.ledger(kept.id)[0]["blob"])
    assert np.array_equal(
        decode_partial(age_partial(content)).pixels, decode_partial(content).pixels
    )
    age_slices(farm, kept)
    done = continued(farm, kept, rule={"name": "fixed", "spp": 40}, max_spp=40)
    after = farm.picture(done, "image.exr")
    one, other = decode_layers(before), decode_layers(after)
    assert all(np.array_equal(one[name], other[name]) for name in one)


def test_files_of_an_old_set_are_made_again_to_the_byte(farm: NoiseFarm) -> None:
    job = finished(farm)
    results = farm.jobs.results(job.id)
    farm.store.delete(f"{results}/facts.json")
    image = decode_layers(farm.picture(job, "image.exr"))
    old = encode_image(
        np.stack([image[name] for name in "RGB"], axis=-1),
        {"plateau:job": job.id, "plateau:spp": job.spp},
    )
    digest = hashlib.sha256(old).hexdigest()
    assert remade(f"{results}/image.exr", digest, farm.jobs, farm.store) == old


def test_a_job_cannot_be_continued_with_other_aovs(farm: NoiseFarm) -> None:
    plain, rich = finished(farm), finished(farm, aovs=["depth"])
    assert loses(farm, plain, aovs=["depth"], max_spp=120) == "aovs"
    assert loses(farm, rich, aovs=["normal"], max_spp=120) == "aovs"


def test_a_job_whose_film_has_alpha_now_fails_in_words(farm: NoiseFarm) -> None:
    stopped = finished(farm)
    age_sums(farm, stopped)
    farm.alpha = True
    done = continued(farm, stopped, rule={"name": "fixed", "spp": 80})
    assert done.state is JobState.FAILED
    assert (
        "slice 4 has the channels R, G, B, W, A, those before it R, G, B, W: submit the scene as "
        "a new job"
    ) in done.reason
    # What it had before is still shown
    assert blobs.of_job(stopped.id) in farm.jobs.results(stopped.id)
    assert decode_layers(farm.picture(stopped, "image.exr")).keys() == {"R", "G", "B"}
