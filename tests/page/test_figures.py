"""Figures that the command line and the page show: each says the same of one thing."""

import re
from typing import Any

import pytest
import redis
from playwright.sync_api import Page, expect
from typer.testing import CliRunner

from plateau.commands import app
from plateau.farm.model.states import JobState
from plateau.farm.redis import keys
from plateau.farm.wire import figures
from plateau.metric.rules.reasons import counted
from tests.page.conftest import Visit
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.farms.staged_job import StagedJob
from tests.support.long_tests import rare

COUNTS = (0.5, 2.5, 9.5, 9.96, 12.5, 232.5, 233.5, 1234, 2_073_600)
FRACTIONS = (0, 1e-7, 0.000113, 0.000125, 0.0125, 0.0363, 0.12345, 0.29, 0.9999, 1)
SECONDS = (0, 4.25, 59.94, 59.96, 90, 119.5, 200.5, 3599.6, 5401, 9000)

#: The page's own words for each of the values, by the name of what says them.
SAY = """async (asked) => {
  const words = await import("/page/shared/figures.js");
  const said = (name, value) => words[name](value).replaceAll("\\u00a0", " ");
  return asked.map(([name, values]) => values.map((value) => said(name, value)));
}"""


def rows(*arguments: str) -> dict[str, str]:
    """The lines that a command prints, by their names."""
    printed = CliRunner().invoke(app, arguments).stdout
    return dict(re.findall(r"^([a-z ]+): +(.+)$", printed, re.MULTILINE))


def test_the_page_rounds_as_the_command_line_and_the_rules_do(page: Page) -> None:
    asked: dict[str, tuple[Any, tuple[float, ...]]] = {
        "pixels": (figures.pixels, COUNTS),
        "three": (figures.significant, (*COUNTS, 0.482, 0.1)),
        "percent": (figures.percent, FRACTIONS),
        "share": (figures.share, FRACTIONS),
        "duration": (figures.duration, SECONDS),
    }
    said = page.evaluate(SAY, [[name, values] for name, (_, values) in asked.items()])
    for (name, (ours, values)), theirs in zip(asked.items(), said, strict=True):
        assert list(map(ours, values)) == theirs, name
    assert [counted(count) for count in COUNTS] == [
        f"{figures.pixels(count)} pixels" for count in COUNTS
    ]


@pytest.mark.parametrize("end", [JobState.CONVERGED, *rare(JobState.CANCELLED)])
def test_a_job_took_as_long_wherever_one_looks(
    visit: Visit,
    farm: NoiseFarm,
    client: redis.Redis,
    url: str,
    monkeypatch: pytest.MonkeyPatch,
    end: JobState,
) -> None:
    # Given a job that waited for 7 s, was rendered for 3 s, and whose results took another 2 s
    job = StagedJob(client, max_spp=5475)
    job.commit(8)
    left = {"estimate_pixels": 232.5, "estimate_fraction": 232.5 / 768}
    job.point(200, 9, **left, estimate_undetermined=True)
    job.end(end)
    job.finish(200)
    ended = float(str(client.hget(keys.job(job.id), "ended_at")))
    times = {"created": -10_100, "started": -3000, "ended": 0, "finished": 2000}
    client.hset(keys.job(job.id), mapping={f"{name}_at": ended + ms for name, ms in times.items()})
    client.hset(keys.job(job.id), "again", '{"of": "0", "kept_spp": 100}')  # paid for by another
    # When it is looked at on the command line and on the page
    monkeypatch.setenv("PLATEAU_URL", url)
    shown, listed = rows("show", job.id), CliRunner().invoke(app, ["list"]).stdout
    page = visit(f"/jobs/{job.id}", expected={404}).page
    # Then it took the time from its submission to its end
    assert shown["time"] == "10.1 s; machine time 4.0 s"
    assert "\t10.1 s\t" in listed
    expect(page.locator(".one-job")).to_contain_text("took 10.1 s")
    expect(page.locator(".facts")).to_contain_text("within 10.1 s since it was submitted")
    # And the noise left is as much
    assert shown["noise left"].startswith("233 px (30.3 %)")
    expect(page.locator(".readout")).to_contain_text("233 px of noise left")
    # And wherever it may be far more, as the samples do not tell how wrong a denoiser is
    assert shown["noise left"].endswith(", undetermined")
    expect(page.locator(".readout")).to_contain_text("233 px of noise left, undetermined")
    # And what a stop of its own saved is the same share of its cap; 100 spp of 768 pixels took 4 s
    if end is JobState.CONVERGED:
        assert shown["saved"] == "96.3 % of the cap, 4,051,200 samples"
        expect(page.locator(".facts")).to_contain_text("96.3 %")
        expect(page.locator(".facts")).to_contain_text("about 3 min 31 s of machine time")
    expect(page.locator(".facts")).to_contain_text("0.0192 M")
