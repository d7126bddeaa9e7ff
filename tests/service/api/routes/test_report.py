"""A job's report: whole, standing alone, and safe to open."""

import base64
import re
from datetime import datetime, timezone
from html.parser import HTMLParser

import httpx
import pytest
import redis

from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.model.job import CurvePoint, WatchedValue
from plateau.farm.model.spec import JobSpec
from plateau.farm.wire.curve_svg import curve_svg, job_svg
from tests.support.farms.staged_job import StagedJob


class Elements(HTMLParser):
    """The elements of a document and their attributes."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs)))


@pytest.fixture
def job(client: redis.Redis, api_store: Blobs) -> StagedJob:
    job = StagedJob(client, watch=[{"name": "reverse"}])
    job.commit(8)
    job.point(100, 0)
    job.point(200, 30, slope=0.25)
    job.picture(api_store, "image.png", b"an image")
    job.picture(api_store, "difference.png", b"a map")
    job.end(reason="it <b>levelled</b> off")
    return job


def test_it_stands_alone(http: httpx.Client, job: StagedJob, client: redis.Redis) -> None:
    answer = http.get(f"/v1/jobs/{job.id}/report.html")
    assert answer.headers["content-type"] == "text/html; charset=utf-8"
    found = Elements(answer.text).found
    pictures = [attributes["src"] or "" for tag, attributes in found if tag == "img"]
    assert [base64.b64decode(one.partition(",")[2]) for one in pictures] == [b"an image", b"a map"]
    for tag, attributes in found:
        assert tag not in {"script", "link", "iframe", "object"}
        assert not any(name.startswith("on") or name in {"href", "style"} for name in attributes)
    assert "<b>levelled" not in answer.text
    # Its figures, its points and its story
    for text in ("200 of at most", "it &lt;b&gt;levelled&lt;/b&gt; off", "0.25", "max_spp"):
        assert text in answer.text
    # Its policy lets its own style in, and nothing else
    policy = answer.headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "sandbox" in policy
    assert re.search(r"style-src 'sha256-[\w+/=]+'", policy)
    assert "script" not in policy
    # It is new with each event
    again = {"If-None-Match": answer.headers["etag"]}
    assert http.get(f"/v1/jobs/{job.id}/report.html", headers=again).status_code == 304
    job.finish(200)
    assert http.get(f"/v1/jobs/{job.id}/report.html", headers=again).status_code == 200
    # A job without an image has one too
    bare = http.get(f"/v1/jobs/{StagedJob(client).id}/report.html")
    assert bare.status_code == 200
    assert "It has no point." in bare.text


@pytest.mark.parametrize(
    ("visible", "estimate"), [(0, None), (1, 0.0), (40_000, 0.02), (3_000_000, 5e6)]
)
def test_any_curve_can_be_drawn(client: redis.Redis, visible: int, estimate: float | None) -> None:
    job = Jobs(client).get(StagedJob(client).id)
    points = [
        CurvePoint(
            spp=spp,
            visible_pixels=visible,
            visible_fraction=0.5,
            slope=None,
            estimate_pixels=estimate,
            estimate_fraction=None,
            at=datetime.now(timezone.utc),
        )
        for spp in (25, 50)
    ]
    drawing = job_svg(job, points)
    numbers = [float(one) for one in re.findall(r'(?:[xy][12]?|c[xy])="([-\d.]+)"', drawing)]
    assert len(numbers) > 20
    assert all(-1 <= number <= 800 for number in numbers)
    assert "nan" not in drawing


def test_the_values_of_a_rule_with_its_own_have_a_plot() -> None:
    points = [
        CurvePoint(
            spp=spp,
            visible_pixels=100,
            visible_fraction=0.1,
            slope=None,
            estimate_pixels=None,
            estimate_fraction=None,
            rules={"jod": WatchedValue(value=value, stop=False)},
            at=datetime.now(timezone.utc),
        )
        for spp, value in ((100, None), (200, 8.4), (300, 9.1))
    ]
    spec = JobSpec.model_validate({"rule": {"name": "jod", "target": 9.5}})
    drawing = curve_svg(spec, 1000, points)
    assert "quality, in JOD" in drawing
    assert "target 9.5 JOD" in drawing
    assert drawing.count("<circle") == 3 + 2
    assert "JOD" not in curve_svg(JobSpec(), 1000, points)
