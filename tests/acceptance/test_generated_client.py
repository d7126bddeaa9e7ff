"""A client that a generator makes of the API's own description: nothing in it is of our hand."""

import importlib
import io
import re
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from plateau.client import DEFAULT_URL
from plateau.farm.images.exr import decode_image
from tests.support.farms.real_farm import BOX, RealFarm

DOCUMENT = Path(__file__).parents[2] / "docs" / "client.md"
#: How to generate it: the generator's settings, and its command.
RECIPE = re.compile(
    r"^```yaml\n(?P<settings>.*?)^```$.*?^    openapi-python-client (?P<arguments>.*?)$",
    re.MULTILINE | re.DOTALL,
)


@pytest.fixture
def generated(farm: RealFarm, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The package that is made as the docs say."""
    recipe = RECIPE.search(DOCUMENT.read_text())
    assert recipe is not None, "the docs do not say how"
    (tmp_path / "plateau.yaml").write_text(recipe["settings"])
    made = subprocess.run(
        [
            *(sys.executable, "-m", "openapi_python_client"),
            *recipe["arguments"].replace(DEFAULT_URL, farm.url).split(),
            "--fail-on-warning",
        ],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert made.returncode == 0, made.stdout + made.stderr
    monkeypatch.syspath_prepend(tmp_path)
    return importlib.import_module("farm_client")


@pytest.fixture
def call(farm: RealFarm, generated: ModuleType) -> Iterator[Callable[..., Any]]:
    """Calls an operation, by its module in the package; what it makes of the answer is returned."""
    with generated.AuthenticatedClient(farm.url, token="none is wanted", timeout=120) as http:

        def call(operation: str, *arguments: Any, **named: Any) -> Any:
            found = importlib.import_module(f"farm_client.api.{operation}")
            return found.sync(*arguments, client=http, **named)

        yield call


@pytest.mark.long
def test_submits_a_zip_waits_and_fetches_an_exr(farm: RealFarm, call: Callable[..., Any]) -> None:
    farm.start("monitor")
    farm.workers(1)
    models = importlib.import_module("farm_client.models")
    types = importlib.import_module("farm_client.types")
    # Given a scene's zip, and a spec made of the client's own classes
    scene = types.File(zipped(BOX), "box.zip", "application/zip")
    spec = models.JobSpec(
        step=8,
        slice_spp=4,
        max_spp=16,
        rule=models.FixedSpec(spp=16),
        parameters=models.JobSpecParameters.from_dict({"width": 32, "height": 24}),
    )
    body = models.SubmitJobBody(scene=scene, spec=spec)
    # If it is submitted, and again with the same key, then it is one job
    job = call("jobs.submit_job", body=body, idempotency_key="a-key")
    assert isinstance(job, models.JobView), job
    scene.payload.seek(0)
    assert call("jobs.submit_job", body=body, idempotency_key="a-key").id == job.id
    # And the stream of its events ends when it is finished
    events = call("results.get_events", job.id)
    assert events.rstrip().rpartition("event: ")[2].startswith("finished")
    done = call("jobs.get_job", job.id)
    assert done.state == models.JobState.CONVERGED, done.reason
    assert (done.spp, done.name) == (16, "box")
    # And its image comes as bytes
    image = decode_image(call("results.get_image_exr", job.id).payload.read())
    assert image.shape == (24, 32, 3)
    assert np.array_equal(image, farm.image(farm.client.job(job.id)))
    # And it goes on by a patch of its spec
    patch = models.SpecChanges.from_dict({"max_spp": 24, "rule": {"name": "fixed", "spp": 24}})
    further = call("jobs.render_again", job.id, body=patch)
    assert (further.again.of, further.spec.max_spp) == (job.id, 24)
    # And an error is a problem
    unknown = call("jobs.get_job", "0" * 12)
    assert isinstance(unknown, models.ProblemDetails)
    assert (unknown.type_, unknown.status) == ("/problems/unknown-job", 404)


def zipped(folder: Path) -> io.BytesIO:
    """A zip of the folder's files."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as bundle:
        for path in sorted(folder.rglob("*")):
            if path.suffix in {".xml", ".ply"}:
                bundle.write(path, path.relative_to(folder).as_posix())
    content.seek(0)
    return content
