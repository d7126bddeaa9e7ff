"""The image of any point of the curve, made again from kept slices: true, and at a bounded cost."""

import asyncio
import threading
from collections.abc import Iterator

import httpx
import numpy as np
import pytest

from plateau.farm.blobs import names as blobs
from plateau.farm.blobs.store import Blobs
from plateau.farm.images.channels import Channels
from plateau.farm.images.exr import Pixels, decode_image
from plateau.farm.model.job import Job
from plateau.picture import previews
from plateau.service.api.points import KeptSlice, SliceLost
from plateau.service.api.points import images as point_images
from plateau.service.api.points import sums as point_sums
from plateau.service.api.points.images import MOST_WAITING, PointImages, TooManyWait
from plateau.service.api.points.sums import PointSums
from tests.support.farms.live_api import live_api
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.until import until

SLICES = 6


def plain(image: Pixels, _: object) -> bytes:
    return image.tobytes()


async def stays() -> bool:
    return False


class CountingBlobs(Blobs):
    """A store that counts how often it is read, and can be made to wait."""

    def __init__(self, where: str) -> None:
        super().__init__(where)
        self.read = 0
        self.may_go_on = threading.Event()
        self.may_go_on.set()

    def get(self, name: str) -> bytes:
        if name.startswith(blobs.JOBS):
            assert self.may_go_on.wait(30)
            self.read += 1
        return super().get(name)


@pytest.fixture
def job(farm: NoiseFarm) -> Job:
    """A job that has kept its six slices, a point each."""
    cap = SLICES * 25
    rule = {"name": "fixed", "spp": cap}
    job = farm.submit(step=25, max_spp=cap, rule=rule, keep_slices=True)
    with farm.monitor():
        farm.render(SLICES)
        until(lambda: farm.jobs.get(job.id).finished_at is not None, 60)
    return farm.jobs.get(job.id)


@pytest.fixture
def http(farm: NoiseFarm, redis_url: str) -> Iterator[httpx.Client]:
    with (
        live_api(redis_url, farm.store) as url,
        httpx.Client(base_url=url, trust_env=False, timeout=60) as http,
    ):
        yield http


def forget_pictures(farm: NoiseFarm, job: Job) -> None:
    """Delete the kept pictures, so that every point is merged from slices."""
    for spp in previews.kept(farm.store, job.id):
        farm.store.delete(blobs.preview(job.id, spp))


class TestOverHttp:
    def test_every_point_has_one(
        self, job: Job, farm: NoiseFarm, http: httpx.Client, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        listed = http.get(f"/v1/jobs/{job.id}/previews").json()["previews"]
        assert [one["spp"] for one in listed] == [25, 50, 75, 100, 125, 150]
        for one in listed:
            answer = http.get(one["link"])
            assert answer.status_code == 200
            assert answer.headers["content-type"] == "image/png"
            assert answer.headers["plateau-spp"] == str(one["spp"])
            assert answer.headers["cache-control"] == "private, max-age=86400"
            tag = {"If-None-Match": answer.headers["etag"]}
            assert http.get(one["link"], headers=tag).status_code == 304
            assert http.head(one["link"]).headers["etag"] == answer.headers["etag"]
        # And what is no point has none
        for spp in (30, 175, 1_000_000):
            answer = http.get(f"/v1/jobs/{job.id}/previews/{spp}.png")
            assert answer.status_code == 404
            assert answer.json()["type"] == "/problems/unknown-point"
            assert "25 spp apart, up to 150" in answer.json()["detail"]
        # It is to the bit what was judged: the job's image at last, and else a kept picture
        root = f"/v1/jobs/{job.id}"
        kept = farm.store.get(blobs.preview(job.id, 25))
        forget_pictures(farm, job)
        assert http.get(f"{root}/previews/150.png").content == farm.picture(job, "image.png")
        assert http.get(f"{root}/previews/25.png").content == kept
        # Where too many wait, more are refused, and films that are too large are left alone
        with monkeypatch.context() as patch:
            patch.setattr(point_images, "MOST_WAITING", 0)
            answer = http.get(f"{root}/previews/100.png")
            assert (answer.status_code, answer.headers["retry-after"]) == (503, "5")
            assert answer.json()["type"] == "/problems/busy"
        monkeypatch.setattr("plateau.service.api.routes.previews.MOST_PIXELS", 32 * 24 - 1)
        assert http.get(f"{root}/previews").json()["previews"] == []
        answer = http.get(f"{root}/previews/50.png")
        assert answer.status_code == 409
        assert "767 pixels" in answer.json()["detail"]

    def test_a_lost_or_spoiled_slice_is_said(
        self, job: Job, farm: NoiseFarm, http: httpx.Client
    ) -> None:
        second = farm.jobs.ledger(job.id)[1]["blob"]
        forget_pictures(farm, job)

        def refused() -> str:
            answer = http.get(f"/v1/jobs/{job.id}/previews/50.png")
            assert answer.status_code == 409
            return str(answer.json()["detail"])

        farm.store.put(second, farm.store.get(second)[:-1] + b"?")
        assert "slice 1 is damaged" in refused()
        farm.store.delete(second)
        assert "slice 1 is gone" in refused()
        assert http.get(f"/v1/jobs/{job.id}/previews/25.png").status_code == 200


class TestItsCost:
    """How often slices are read, and who waits for whom."""

    @pytest.fixture
    def store(self, farm: NoiseFarm) -> CountingBlobs:
        return CountingBlobs(farm.store.where)

    @pytest.fixture
    def slices(self, farm: NoiseFarm, job: Job) -> list[KeptSlice]:
        ledger = farm.jobs.ledger(job.id).values()
        return [KeptSlice(record["blob"], record["sha256"]) for record in ledger]

    def test_later_points_go_on_from_earlier_ones(
        self, store: CountingBlobs, slices: list[KeptSlice]
    ) -> None:
        images = PointImages(store)
        answers = []
        for count, read in ((3, 3), (3, 3), (5, 5), (4, 6), (6, 7)):
            found = asyncio.run(images.encoded("job", slices[:count], plain, stays))
            assert store.read == read
            answers.append(found)
        # And none of them is changed by what came later
        assert answers[0] == answers[1]
        fresh = PointImages(store)
        for count, found in zip((3, 5, 4, 6), answers[1:], strict=True):
            assert asyncio.run(fresh.encoded(f"{count}", slices[:count], plain, stays)) == found
        # Another job's slices are its own
        before = store.read
        asyncio.run(images.encoded("other", slices[:2], plain, stays))
        assert store.read == before + 2
        images.close()
        fresh.close()

    def test_the_last_sum_is_the_image_to_the_bit(
        self, farm: NoiseFarm, job: Job, slices: list[KeptSlice]
    ) -> None:
        sums = PointSums(farm.store)
        early, last = (
            sums.image(job.id, slices[:count], is_given_up=lambda: False) for count in (1, SLICES)
        )
        assert early is not None
        assert np.array_equal(last, decode_image(farm.picture(job, "image.exr")))
        # Noise falls with samples
        assert early[:, 0].std() / last[:, 0].std() == pytest.approx(SLICES**0.5, rel=0.35)

    def test_what_is_remembered_is_bounded(
        self,
        store: CountingBlobs,
        slices: list[KeptSlice],
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        monkeypatch.setattr(point_sums, "_REMEMBERED", 2 * 24 * 32 * 4 * 8)
        sums = PointSums(store)
        for job in ("a", "b", "c"):
            sums.image(job, slices, is_given_up=lambda: False)
        assert list(sums._sums) == [("b", SLICES), ("c", SLICES)]

    def test_nobody_is_worked_for_who_has_gone(
        self, store: CountingBlobs, slices: list[KeptSlice]
    ) -> None:
        async def leaves() -> bool:
            store.may_go_on.set()
            return True

        images = PointImages(store)
        store.may_go_on.clear()
        assert asyncio.run(images.encoded("job", slices, plain, leaves)) is None
        images._worker.submit(int).result(30)
        assert store.read < SLICES
        images.close()

    def test_few_may_wait(self, store: CountingBlobs, slices: list[KeptSlice]) -> None:
        images = PointImages(store)
        store.may_go_on.clear()

        async def all_at_once() -> list[bytes | BaseException | None]:
            asked = [
                asyncio.ensure_future(images.encoded("job", slices, plain, stays))
                for _ in range(MOST_WAITING + 2)
            ]
            await asyncio.wait(asked, return_when=asyncio.FIRST_COMPLETED)
            store.may_go_on.set()
            return await asyncio.gather(*asked, return_exceptions=True)

        answers = asyncio.run(all_at_once())
        refused = [one for one in answers if isinstance(one, TooManyWait)]
        assert len(refused) == 2
        assert store.read == SLICES  # the first one's sum was everybody's
        images.close()

    def test_a_slice_of_another_size_is_refused(
        self, store: CountingBlobs, slices: list[KeptSlice]
    ) -> None:
        sums = PointSums(store)
        sums.image("job", slices[:1], is_given_up=lambda: False)
        sums._sums["job", 1] = point_sums.Sum(Channels(), np.zeros((2, 2, 4)))
        with pytest.raises(SliceLost, match="another size"):
            sums.image("job", slices[:2], is_given_up=lambda: False)
