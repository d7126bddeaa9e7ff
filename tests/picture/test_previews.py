"""The pictures that a job keeps of its way: few, well spread, and true."""

import hashlib
import io
from itertools import pairwise
from typing import ClassVar

import numpy as np
import pytest
from PIL import Image

from plateau.farm.blobs import names as blobs
from plateau.farm.blobs.store import Blobs
from plateau.farm.images.exr import decode_image
from plateau.picture.previews import LEAST, MOST, MOST_BYTES, Previews, kept, missed_least
from plateau.picture.result_files import LONGEST, thumbnail
from tests.support.farms.live_api import live_http
from tests.support.farms.noise_farm import NoiseFarm, noise_film
from tests.support.until import until


def test_the_one_that_is_missed_least_lies_between_the_closest_by_ratio() -> None:
    assert missed_least([100, 200, 300, 400]) == 300  # 400/200 = 2, 300/100 = 3
    assert missed_least([100, 110, 1000]) == 110


def previews_of(store: Blobs, noted: dict[str, str | None] | None = None) -> Previews:
    """The previews of a job; what is noted of their bytes goes into a dictionary."""
    noted = {} if noted is None else noted
    return Previews(store, "job", note=noted.__setitem__)


def test_they_stay_spread_however_many_come(store: Blobs) -> None:
    noted: dict[str, str | None] = {}
    previews = previews_of(store, noted)
    large = bytes(MOST_BYTES // LEAST + 1)
    for spp in range(100, 10_001, 100):
        previews.keep(spp, large)
    spps = kept(store, "job")
    assert len(spps) == LEAST
    assert (spps[0], spps[-1]) == (100, 10_000)
    ratios = [after / before for before, after in pairwise(spps)]
    assert max(ratios[1:]) < 1.8  # the first step, from 100 to 200, is 2
    # And of each that there is, and of no other, it is noted what its bytes are
    sha256 = hashlib.sha256(large).hexdigest()
    known = {blob: digest for blob, digest in noted.items() if digest is not None}
    assert known == {blobs.preview("job", spp): sha256 for spp in spps}


def test_small_ones_are_all_kept_up_to_a_number(store: Blobs) -> None:
    previews = previews_of(store)
    for spp in range(1, MOST + 1):
        previews.keep(spp, b"picture")
    assert kept(store, "job") == list(range(1, MOST + 1))
    previews.keep(MOST + 1, b"picture")
    spps = kept(store, "job")
    assert len(spps) == MOST
    assert (spps[0], spps[-1]) == (1, MOST + 1)


def test_no_more_bytes_are_kept_than_agreed(store: Blobs) -> None:
    previews = previews_of(store)
    half = bytes(MOST_BYTES // (2 * LEAST))
    for spp in range(1, 61):
        previews.keep(spp, half)
    assert len(kept(store, "job")) == 2 * LEAST


def test_a_monitor_that_takes_over_goes_on_with_what_there_is(store: Blobs) -> None:
    previews_of(store).keep(100, b"one")
    heir = previews_of(store)
    heir.keep(200, b"two")
    heir.keep(100, b"one")
    assert kept(store, "job") == [100, 200]
    assert store.get(blobs.preview("job", 100)) == b"one"


def test_a_preview_over_http_is_what_the_image_was(farm: NoiseFarm, redis_url: str) -> None:
    job = farm.submit(step=25, max_spp=75, rule={"name": "fixed", "spp": 75})
    path = f"/v1/jobs/{job.id}"
    with live_http(redis_url, farm.store) as http, farm.monitor():
        assert http.get(f"{path}/previews").json() == {"previews": []}
        farm.render(1)
        until(lambda: bool(farm.jobs.results(job.id)))
        newest = http.get(f"{path}/image.png")
        until(lambda: kept(farm.store, job.id) == [25])
        farm.render(2)
        until(lambda: farm.jobs.get(job.id).finished_at is not None)
        listed = http.get(f"{path}/previews").json()["previews"]
        assert listed[0] == {"spp": 25, "link": f"{path}/previews/25.png"}
        preview = http.get(f"{path}/previews/25.png")
        final = http.get(f"{path}/image.png")
        # It is what was shown then, and never changes
        assert preview.content == newest.content != final.content
        assert [one.headers["plateau-spp"] for one in (newest, preview, final)] == [
            "25",
            "25",
            "75",
        ]
        again = {"If-None-Match": preview.headers["etag"]}
        assert http.get(f"{path}/previews/25.png", headers=again).status_code == 304
        # One that is not kept is a problem that says where to look
        problem = http.get(f"{path}/previews/30.png").json()
        assert problem["type"] == "/problems/unknown-point"
        assert f"GET {path}/previews" in problem["detail"]
        small = Image.open(io.BytesIO(http.get(f"{path}/thumbnail.png").content))
        assert small.size == (32, 24)


class TestAThumbnail:
    def test_is_small_whatever_the_image_is(self) -> None:
        assert thumbnail(np.ones((1080, 1921, 3), np.float32), 0).shape == (99, 175, 3)
        assert thumbnail(np.ones((5, 1000, 3), np.float32), 0).shape == (1, 167, 3)
        assert thumbnail(np.ones((20, 30, 3), np.float32), 0).shape == (20, 30, 3)
        assert max(thumbnail(np.ones((193, 1, 3), np.float32), 0).shape) <= LONGEST

    def test_averages_light_and_not_codes(self) -> None:
        assert thumbnail(np.full((400, 400, 3), np.nan, np.float32), 0).max() == 0
        stripes = np.zeros((400, 400, 3), np.float32)
        stripes[::3] = 1.0
        middle = thumbnail(stripes, 0)[50, 50]
        assert (abs(middle.astype(int) - 156) <= 1).all()  # the code of 1/3; of the codes it is 85


class TestAGlimpse:
    """The first pass of the first slice, which may take minutes."""

    SPEC: ClassVar = {"step": 100, "slice_spp": 10, "max_spp": 1000}

    def test_is_shown_until_the_first_slice_is_there(self, farm: NoiseFarm) -> None:
        job = farm.submit(**self.SPEC)
        with farm.monitor():
            lease = farm.next_lease()
            glimpse = farm.glimpse(lease, 4)
            until(lambda: farm.jobs.get(job.id).image_spp == 4)
            assert Image.open(io.BytesIO(farm.picture(job, "image.png"))).size == (32, 24)
            expected = noise_film(0, 4, farm.sigma)
            np.testing.assert_array_equal(
                decode_image(farm.picture(job, "image.exr")), expected[..., :3] / expected[..., 3:]
            )
            until(lambda: not farm.store.exists(glimpse))
            # It counts for nothing else
            assert (farm.jobs.get(job.id).spp, farm.jobs.get(job.id).committed_spp) == (0, 0)
            farm.commit(lease)
            until(lambda: farm.jobs.get(job.id).image_spp == 10)
            until(
                lambda: len({n.split("/")[3] for n in farm.store.names(blobs.results(job.id))}) == 1
            )
            # Only pictures of points are kept of the job's way
            assert kept(farm.store, job.id) == []
            farm.jobs.cancel(job.id)
            until(lambda: farm.jobs.get(job.id).finished_at is not None)
        assert farm.jobs.get(job.id).image_spp == 10
        assert farm.jobs.get(job.id).spp == 10

    def test_is_no_result(self, farm: NoiseFarm) -> None:
        job = farm.submit(**self.SPEC)
        with farm.monitor():
            farm.glimpse(farm.next_lease(), 4)
            until(lambda: farm.jobs.get(job.id).image_spp == 4)
            farm.jobs.cancel(job.id)
            until(lambda: farm.jobs.get(job.id).finished_at is not None)
        assert (farm.jobs.get(job.id).image_spp, farm.jobs.get(job.id).spp) == (None, 0)
        assert farm.store.names(blobs.of_job(job.id)) == []

    @pytest.mark.parametrize("is_torn", [True, False])
    def test_that_is_spoiled_costs_nothing_else(
        self, farm: NoiseFarm, is_torn: bool, caplog: pytest.LogCaptureFixture
    ) -> None:
        job = farm.submit(**self.SPEC)
        with farm.monitor():
            lease = farm.next_lease()
            # Or as large as its slice
            farm.glimpse(lease, 4, b"torn") if is_torn else farm.glimpse(lease, 10)
            until(lambda: "the first pass cannot be shown" in caplog.text)
            farm.commit(lease)
            until(lambda: farm.jobs.get(job.id).image_spp == 10)
            farm.jobs.cancel(job.id)
            until(lambda: farm.jobs.get(job.id).finished_at is not None)
        assert caplog.text.count("the first pass cannot be shown") == 1
