"""A job that has come to its end beside another, which are only looked at; and the pixels shown."""

import io
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Browser, Locator, Page, expect

from plateau.farm.blobs import names as blobs
from plateau.farm.model.job import Job
from plateau.farm.redis.embedded import EmbeddedRedis
from plateau.farm.redis.link import connect
from plateau.picture.previews import kept
from tests.support.farms.live_api import live_api
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.processes.browser import Visitor
from tests.support.until import until

SPEC = {
    "step": 25,
    "max_spp": 250,
    "rule": {"name": "fixed", "spp": 200},
    "watch": [{"name": "visible", "target": 0.001}, {"name": "reverse"}],
}

#: The colours of the layer that is shown, as a list of bytes; nothing while it is being loaded.
PIXELS = """(layer) => {
  if (layer.complete === false || layer.naturalWidth === 0) return null;
  const canvas = document.createElement("canvas");
  canvas.width = layer.naturalWidth ?? layer.width;
  canvas.height = layer.naturalHeight ?? layer.height;
  const context = canvas.getContext("2d");
  context.drawImage(layer, 0, 0);
  const { data } = context.getImageData(0, 0, canvas.width, canvas.height);
  return [canvas.width, canvas.height, ...data.filter((_, at) => at % 4 < 3)];
}"""


def pixels(layer: Locator) -> np.ndarray:
    loaded = layer.page.wait_for_function(PIXELS, arg=layer.element_handle())
    width, height, *values = loaded.json_value()
    return np.array(values, np.int16).reshape(height, width, 3)


def png(content: bytes) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(content)).convert("RGB")).astype(np.int16)


def is_shown(layer: Locator, picture: np.ndarray) -> None:
    """Assert that a layer shows these pixels, soon and to the last one."""
    until(lambda: bool((pixels(layer) == picture).all()))


@dataclass(frozen=True)
class Finished:
    """Two jobs that have come to their end, and where they can be seen.

    The first kept a few pictures of its way, `other` all of its slices.
    """

    farm: NoiseFarm
    job: Job
    other: Job
    url: str
    previews: list[int]

    def preview(self, spp: int) -> np.ndarray:
        return png(self.farm.store.get(blobs.preview(self.job.id, spp)))


@pytest.fixture(scope="session")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Finished]:
    """They have a Redis of their own, which no test empties."""
    folder = tmp_path_factory.mktemp("finished")
    server = EmbeddedRedis(folder / "redis")
    client = connect(server.url, 120.0)
    farm = NoiseFarm(client, server.url, folder)
    job = farm.submit("box", **SPEC)
    with farm.monitor():
        farm.render(1)
        until(lambda: 25 in kept(farm.store, job.id), 200)
        farm.render(3)  # the newest preview is kept within ten seconds of the one before
        until(lambda: 100 in kept(farm.store, job.id), 200)
        job = farm.finish(job)
        other = farm.finish(farm.submit("dawn", **SPEC, seed=7, keep_slices=True))
    with live_api(server.url, farm.store) as url:
        spps = kept(farm.store, job.id)
        assert len(spps) > 1
        yield Finished(farm, job, other, url, spps)
    client.close()
    server.stop()


@pytest.fixture(scope="module")
def looker(browser: Browser, finished: Finished) -> Iterator[Visitor]:
    """Who looks at the finished jobs, again and again."""
    visitor = Visitor(browser, finished.url)
    yield visitor
    visitor.leave()


@pytest.fixture
def shown(looker: Visitor, finished: Finished) -> Page:
    """The finished job's screen, as it is at first."""
    page = looker.page
    page.mouse.move(0, 0)
    page.goto(f"/jobs/{finished.job.id}")
    expect(page.locator(".frame .layer").first).to_be_visible()
    return page
