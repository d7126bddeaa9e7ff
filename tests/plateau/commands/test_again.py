"""`plateau again`: new jobs from ended ones, by the command line."""

import json
import os
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
import redis

from plateau.farm.model.job import Job
from plateau.farm.wire.examples import SCENE_XML
from tests.support.farms.live_api import live_api
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.farms.receiver import SECRET
from tests.support.processes.commands import plateau

SHORT = {"step": 20, "slice_spp": 10, "max_spp": 400, "rule": {"name": "fixed", "spp": 40}}


@pytest.fixture
def farm(
    client: redis.Redis, redis_url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[NoiseFarm]:
    farm = NoiseFarm(client, redis_url, tmp_path)
    with live_api(redis_url, farm.store) as url:
        monkeypatch.setenv("PLATEAU_URL", url)
        yield farm


def ended(farm: NoiseFarm, **spec: object) -> Job:
    job = farm.submit(**{**SHORT, **spec})
    with farm.monitor():
        return farm.finish(job)


def test_an_ended_job_goes_on_under_the_id_that_is_printed(farm: NoiseFarm) -> None:
    job = ended(farm, view={"exposure_ev": 1.0})
    code, out, err = plateau("again", job.id[:8], "--rule", "visible:target=0.01", "--json")
    assert code == 0
    new = json.loads(out)
    assert new["again"] == {"of": job.id, "kept_spp": 40, "why": None}
    said = f"keeps 40 spp of job {job.id}"
    assert f"job {new['id']} {said}" in err
    assert f"it {said}" in plateau("show", new["id"])[1]
    # What was given is another, and the rest is as it was
    assert new["spec"]["rule"] == {"name": "visible", "target": 0.01, "min_spp": 200}
    assert new["spec"]["view"] == job.spec.view.model_dump(mode="json")
    code, out, _ = plateau("again", job.id, "--max-spp", "600", "--spp", "500")
    assert farm.jobs.get(out.strip()).spec.max_spp == 600
    assert farm.jobs.get(out.strip()).spec.rule.model_dump() == {"name": "fixed", "spp": 500}


def test_a_scene_is_rendered_anew_with_what_was_changed(farm: NoiseFarm) -> None:
    files = {"scene": ("box.xml", SCENE_XML)}
    asked = {
        **SHORT,
        "parameters": {"width": "64", "height": "48"},
        "view": {"exposure_ev": 1.0},
        "watch": [{"name": "visible"}],
        "keep_slices": True,
        "notice": {"url": "https://studio.example/hook", "secret": SECRET},
    }
    url = f"{os.environ['PLATEAU_URL']}/v1/jobs"
    files |= {"spec": ("spec.json", json.dumps(asked))}
    answer = httpx.post(url, files=files, timeout=60)
    assert answer.status_code == 201, answer.text
    old = answer.json()
    farm.jobs.cancel(old["id"])
    options = ("--max-spp", "600", "-D", "width=32", "--white-luminance", "300")
    code, out, err = plateau("again", old["id"][:8], *options)
    assert (code, "waits for a worker" in err) == (0, True)
    assert f"renders job {old['id']} anew: none of its samples are left" in err
    new = farm.jobs.get(out.strip())
    assert new.scene_sha256 == old["scene_sha256"]
    # Then what was given is another, the rest is as it was, and the notice's URL is left out
    assert new.spec.model_dump(mode="json") == {
        **old["spec"],
        "max_spp": 600,
        "parameters": {"width": "32", "height": "48"},
        "view": {**old["spec"]["view"], "white_luminance": 300},
        "notice": {"url": None, "targets": []},
    }
    code, _, err = plateau("again", old["id"], "--max-spp", "0")
    assert (code, "spec.max_spp" in err) == (1, True)
