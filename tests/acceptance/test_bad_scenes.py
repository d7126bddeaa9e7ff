"""A bad scene gets a clear error, and costs nobody else anything."""

import zipfile
from pathlib import Path

import httpx
import pytest

from tests.support.farms.real_farm import RealFarm

SCENE = """<scene version="3.0.0">
  <integrator type="path"/>
  <sensor type="perspective"><film type="hdrfilm">
    <integer name="width" value="{width}"/><integer name="height" value="8"/>
  </film></sensor>
  <shape type="{shape}">{more}</shape>
  <emitter type="constant"/>
</scene>"""
QUICK = '{"step": 2, "slice_spp": 1, "max_spp": 4, "rule": {"name": "fixed", "spp": 4}}'


def good() -> bytes:
    return SCENE.format(width=8, shape="sphere", more="").encode()


def post(farm: RealFarm, content: bytes, spec: str = QUICK) -> httpx.Response:
    return httpx.post(
        f"{farm.client.url}/v1/jobs", files={"scene": ("a", content)}, data={"spec": spec}
    )


@pytest.fixture(scope="module")
def escaping_zip(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("zips") / "escape.zip"
    with zipfile.ZipFile(path, "w") as bundle:
        bundle.writestr("scene.xml", good())
        bundle.writestr("../outside.txt", "x")
    return path.read_bytes()


def test_each_bad_scene_is_refused_or_fails_in_words_and_the_next_job_runs(
    farm: RealFarm, escaping_zip: bytes, tmp_path: Path
) -> None:
    farm.start("monitor")
    farm.workers(1)
    # Refused at the door
    missing = SCENE.format(width=8, shape="ply", more='<string name="filename" value="no.ply"/>')
    for content, words in [
        (b"", "empty"),
        (b"<scene", "XML"),
        (b"PK\x03\x04 no zip", "zip"),
        (missing.encode(), "no.ply"),
        (SCENE.format(width=0, shape="sphere", more="").encode(), "width"),
        (SCENE.format(width=8, shape="sfere", more="").encode(), "did you mean 'sphere'?"),
        (escaping_zip, ".."),
    ]:
        answer = post(farm, content)
        assert 400 <= answer.status_code < 500, words
        assert answer.headers["content-type"] == "application/problem+json"
        assert words in answer.text
    # Or failed by the worker, with Mitsuba's words
    more = '<float name="nosuchproperty" value="1"/>'
    answer = post(farm, SCENE.format(width=8, shape="sphere", more=more).encode())
    assert answer.status_code == 201
    failed = farm.client.wait(answer.json()["id"])
    assert failed.state == "failed"
    assert "nosuchproperty" in failed.reason
    # And then a good one runs
    done = farm.client.wait(post(farm, good()).json()["id"])
    assert (done.state, done.spp) == ("converged", 4)
    assert all(process.poll() is None for process in farm.processes)
