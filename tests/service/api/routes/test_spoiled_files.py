"""Stored files whose bytes were damaged are made again, or refused; they are never served."""

import base64
import hashlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx
import numpy as np
import pytest
import redis

from plateau.farm.blobs import names as blobs
from plateau.farm.model.job import Job
from plateau.farm.redis import keys
from tests.support.farms.live_api import live_api
from tests.support.farms.noise_farm import NoiseFarm, noise_film
from tests.support.until import until

PICTURES = (
    *("image.exr", "image.png", "thumbnail.png"),
    *("difference.png", "noise.png", "quality.png", "non-finite.png"),
)
FIXED = {"name": "fixed", "spp": 40}
SPEC = {"step": 20, "slice_spp": 10, "max_spp": 40, "rule": FIXED, "watch": [{"name": "jod"}]}


@pytest.fixture
def farm(client: redis.Redis, redis_url: str, tmp_path: Path) -> NoiseFarm:
    return NoiseFarm(client, redis_url, tmp_path)


@pytest.fixture
def api(farm: NoiseFarm, redis_url: str) -> Iterator[httpx.Client]:
    """An API that has read nothing yet."""
    with fresh_api(farm, redis_url) as http:
        yield http


@contextmanager
def fresh_api(farm: NoiseFarm, redis_url: str) -> Iterator[httpx.Client]:
    options = {"trust_env": False, "verify": False, "timeout": 60}
    with live_api(redis_url, farm.store) as url, httpx.Client(base_url=url, **options) as http:
        yield http


def finished(farm: NoiseFarm, **spec: object) -> Job:
    """A finished job, of whose image one pixel is NaN, so that it has every picture."""
    job = farm.submit(**{**SPEC, **spec})

    def step() -> bool:
        lease = farm.lease()
        if lease is not None:
            film = noise_film(lease.index, 10, 1.0)
            film[3, 4, 0] = np.nan
            farm.commit(lease, film)
        return farm.is_finished(job)

    with farm.monitor():
        until(step)
    return farm.jobs.get(job.id)


def spoil(farm: NoiseFarm, blob: str) -> None:
    """Turn a byte in the middle of a stored file, as an old disk does."""
    path = Path(farm.store.where) / blob
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 0x40
    path.write_bytes(content)


def lose(farm: NoiseFarm, blob: str) -> None:
    (Path(farm.store.where) / blob).unlink()


def is_refused(answer: httpx.Response, blob: str) -> None:
    assert answer.status_code == 500
    problem = answer.json()
    assert problem["type"] == "/problems/spoiled-file"
    assert blob in problem["detail"]
    assert "restore that blob from a backup, or render the scene again" in problem["detail"]


def stands_on_nothing(farm: NoiseFarm, client: redis.Redis, job: Job) -> None:
    """Take away what a job's pictures could be made from again, as its time does."""
    client.hdel(keys.job(job.id), "checkpoint")
    farm.store.delete(*farm.store.names(blobs.checkpoints(job.id)))


@pytest.mark.parametrize(("keep_slices", "harm"), [(False, lose), (True, spoil)])
def test_pictures_are_made_again_from_sums_or_slices(
    farm: NoiseFarm, api: httpx.Client, keep_slices: bool, harm: Callable[[NoiseFarm, str], None]
) -> None:
    job = finished(farm, keep_slices=keep_slices)
    for name in PICTURES:
        # Given a picture that is damaged or lost
        blob = f"{farm.jobs.results(job.id)}/{name}"
        written = farm.store.get(blob)
        harm(farm, blob)
        # When it is asked for
        answer = api.get(f"/v1/jobs/{job.id}/{name}")
        # Then it is what it was, to the byte, and so it is again in the store
        assert answer.status_code == 200, answer.text
        assert answer.content == written
        assert farm.store.get(blob) == written
        # And says so as RFC 9530 has it
        digest = base64.b64encode(hashlib.sha256(written).digest()).decode()
        assert answer.headers["repr-digest"] == f"sha-256=:{digest}:"
    # Nothing of what went is remembered
    noted = farm.jobs._redis.hkeys(keys.job(job.id, "digests"))
    results = farm.jobs.results(job.id).removeprefix(blobs.of_job(job.id))
    assert {one for one in noted if one.startswith("results/")} == {
        f"{results}/{name}" for name in (*PICTURES, "facts.json")
    }


def test_a_picture_that_cannot_be_made_again_is_refused_with_words(
    farm: NoiseFarm, client: redis.Redis, api: httpx.Client, caplog: pytest.LogCaptureFixture
) -> None:
    job = finished(farm)
    stands_on_nothing(farm, client, job)
    for name in PICTURES:
        blob = f"{farm.jobs.results(job.id)}/{name}"
        written = farm.store.get(blob)
        spoil(farm, blob)
        for _ in range(2):
            is_refused(api.get(f"/v1/jobs/{job.id}/{name}"), blob)
        assert api.head(f"/v1/jobs/{job.id}/{name}").status_code == 500
        # Its operator is told of it once
        errors = [one.getMessage() for one in caplog.records if one.levelname == "ERROR"]
        assert [blob in error for error in errors] == [True]
        caplog.clear()
        # Where somebody brings it back, it is there again
        farm.store.put(blob, written)
        assert api.get(f"/v1/jobs/{job.id}/{name}").content == written


def test_sums_that_are_damaged_too_make_nothing_again(farm: NoiseFarm, api: httpx.Client) -> None:
    job = finished(farm)
    blob = f"{farm.jobs.results(job.id)}/image.png"
    (sums,) = farm.store.names(blobs.checkpoints(job.id))
    spoil(farm, sums)
    spoil(farm, blob)
    is_refused(api.get(f"/v1/jobs/{job.id}/image.png"), blob)


def test_a_running_job_has_a_whole_image_again_with_its_next(
    farm: NoiseFarm, api: httpx.Client
) -> None:
    job = farm.submit(**{**SPEC, "step": 10})
    with farm.monitor():
        farm.render(1)
        until(lambda: farm.jobs.get(job.id).image_spp == 10)
        spoil(farm, blob := f"{farm.jobs.results(job.id)}/image.png")
        is_refused(api.get(f"/v1/jobs/{job.id}/image.png"), blob)
        farm.finish(job)
    assert api.get(f"/v1/jobs/{job.id}/image.png").content == farm.picture(job, "image.png")


def test_what_an_earlier_plateau_wrote_is_served_as_it_is(
    farm: NoiseFarm, client: redis.Redis, api: httpx.Client
) -> None:
    job = finished(farm)
    client.delete(keys.job(job.id, "digests"))
    for name in PICTURES:
        answer = api.get(f"/v1/jobs/{job.id}/{name}")
        assert answer.content == farm.picture(job, name)
        assert "repr-digest" not in answer.headers


def test_previews_are_merged_again_from_slices_or_refused(
    farm: NoiseFarm, api: httpx.Client
) -> None:
    for keep_slices in (True, False):
        job = finished(farm, keep_slices=keep_slices)
        blob = blobs.preview(job.id, 20)
        written = farm.store.get(blob)
        spoil(farm, blob)
        answer = api.get(f"/v1/jobs/{job.id}/previews/20.png")
        if keep_slices:
            assert answer.content == written
            damaged = farm.jobs.ledger(job.id)[1]["blob"]
            spoil(farm, damaged)
            is_refused(api.get(f"/v1/jobs/{job.id}/slices/1.exr"), damaged)
            assert api.get(f"/v1/jobs/{job.id}/slices/0.exr").status_code == 200
        else:
            is_refused(answer, blob)


def test_a_job_that_goes_on_shows_no_damaged_image_of_the_first(
    farm: NoiseFarm, client: redis.Redis, api: httpx.Client
) -> None:
    first = finished(farm)
    path = f"/v1/jobs/{first.id}/again"
    second = api.post(path, json={"max_spp": 80, "rule": {"name": "fixed", "spp": 80}}).json()
    blob = f"{farm.jobs.results(second['id'])}/image.png"
    assert blob.startswith(blobs.results(first.id))
    written = farm.store.get(blob)
    spoil(farm, blob)
    assert api.get(f"/v1/jobs/{second['id']}/image.png").content == written
