"""Steering workers over HTTP."""

import httpx
import redis

from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.queue import SliceQueue
from plateau.farm.model.spec import JobSpec
from plateau.farm.redis import keys
from plateau.farm.wire.examples import SCENE_XML
from tests.support.api_calls import problem, submit
from tests.support.farms.ledger_farm import LedgerFarm, about, live_on


def test_demand_is_counted_for_the_variants_of_a_pool(
    http: httpx.Client, client: redis.Redis
) -> None:
    for variant, slices in (("cuda_ad_rgb", 2), ("scalar_rgb", 3)):
        LedgerFarm(client).job(slices, variant=variant)
    assert SliceQueue(client, "w-1", 60).lease(("scalar_rgb",), None, in_turn=False) is not None

    def demand(**asked: str | list[str]) -> dict[str, int]:
        return http.get("/v1/demand", params=asked).json()

    assert demand() == {"slices": 5, "waiting": 4, "leased": 1}
    assert demand(variant="cuda_ad_rgb") == {"slices": 2, "waiting": 2, "leased": 0}
    assert demand(variant=["llvm_ad_rgb", "scalar_rgb"]) == {"slices": 3, "waiting": 2, "leased": 1}
    assert demand(variant="mitsuba:cuda_ad_rgb") == demand(variant="cuda_ad_rgb")
    assert demand(variant="analytic:numpy")["slices"] == 0
    assert demand(pool="default", tag="") == demand()
    assert demand(pool="night")["slices"] == 0
    assert http.get("/v1/demand", params={"variant": "vulkan"}).status_code == 422
    for name in ("", "a b", "-night", "n" * 41, "nächtlich", "night\n"):
        for parameter in ("pool", "tag"):
            status = http.get("/v1/demand", params={parameter: name}).status_code
            # No tag at all is asked for by an empty one
            assert status == (200 if (parameter, name) == ("tag", "") else 422), (parameter, name)


def test_a_job_that_no_worker_may_render_says_so(http: httpx.Client, client: redis.Redis) -> None:
    asked = {"pool": "night", "requires": ["gpu"], "variant": "llvm_ad_rgb"}
    made = submit(http, SCENE_XML, asked)
    assert made.status_code == 201
    words = (
        "waits for a worker that renders llvm_ad_rgb in pool night with tags gpu: there is none "
        "that takes work"
    )

    def waits_for() -> set[str | None]:
        of_the_list = [one["waits_for"] for one in http.get("/v1/jobs").json()["jobs"]]
        return {http.get(f"/v1/jobs/{made.json()['id']}").json()["waits_for"], *of_the_list}

    def unserved() -> str:
        lines = http.get("/metrics").text.splitlines()
        return next(line for line in lines if line.startswith("plateau_jobs_unserved"))

    def queued(job: str) -> list[tuple[int, int]]:
        (listed,) = (one for one in http.get("/v1/jobs").json()["jobs"] if one["id"] == job)
        named = http.get(f"/v1/jobs/{job}").json()
        return [(one["queue_place"], one["fitting_workers"]) for one in (named, listed)]

    assert made.json()["waits_for"] == words
    assert (waits_for(), unserved()) == ({words}, "plateau_jobs_unserved 1.0")
    assert queued(made.json()["id"]) == [(1, 0)] * 2
    fits = {"pool": "night", "tags": ["gpu"], "variants": ["llvm_ad_rgb"], "samples_per_s": 2e6}
    # One that lacks a tag is of no use
    SliceQueue(client, "w-0", 60).heartbeat({**about("w-0"), **fits, "tags": []}, ())
    assert waits_for() == {words}
    SliceQueue(client, "w-1", 60).heartbeat({**about("w-1"), **fits}, ())
    live_on(client, "w-1")
    assert (waits_for(), unserved()) == ({None}, "plateau_jobs_unserved 0.0")
    assert queued(made.json()["id"]) == [(1, 1)] * 2
    shown = {one["id"]: one for one in http.get("/v1/workers").json()["workers"]}["w-1"]
    assert {name: shown[name] for name in fits} == fits


def test_a_need_too_many_is_a_problem(http: httpx.Client, client: redis.Redis) -> None:
    for number in range(keys.MOST_NEEDS):
        Jobs(client).create(JobSpec(pool=f"p{number}"), name="box", scene_sha256="00")
    problem(submit(http, SCENE_XML, {"pool": "p"}), 409, "too-many-needs")
