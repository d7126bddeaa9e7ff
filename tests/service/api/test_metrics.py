"""``GET /metrics`` says how the farm is; docs and dashboard know all of it."""

import json
import re
from pathlib import Path

import httpx
import pytest
import redis
from prometheus_client import Metric
from prometheus_client.parser import text_string_to_metric_families

from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.totals import note_sweep
from plateau.farm.process.settings import Settings
from plateau.farm.redis import keys
from tests.support.api_calls import problem
from tests.support.farms.live_api import live_http
from tests.support.farms.staged_job import HEIGHT, WIDTH, StagedJob
from tests.support.until import until

ROOT = Path(__file__).parents[3]
LATENCY = "plateau_http_request_duration_seconds"


class Scrape:
    """One answer of ``GET /metrics``."""

    def __init__(self, http: httpx.Client) -> None:
        answer = http.get("/metrics")
        assert answer.status_code == 200
        assert answer.headers["content-type"] == "text/plain; version=0.0.4; charset=utf-8"
        self.families: list[Metric] = list(text_string_to_metric_families(answer.text))
        self.samples = {
            (sample.name, *sorted(sample.labels.items())): sample.value
            for family in self.families
            for sample in family.samples
        }

    def value(self, name: str, **labels: str) -> float | None:
        return self.samples.get((name, *sorted(labels.items())))

    def names(self) -> set[str]:
        """The names as the docs have them."""
        return {
            f"{family.name}_total" if family.type == "counter" else family.name
            for family in self.families
        }

    def series(self) -> set[str]:
        """The names as expressions have them."""
        return {name for name, *_ in self.samples}


@pytest.fixture
def busy(http: httpx.Client, client: redis.Redis) -> StagedJob:
    """A farm of which every metric tells."""
    note_sweep(client)
    http.get("/healthz")
    job = StagedJob(client, max_spp=1000)
    job.die("SIGSEGV")
    job.commit(4)
    job.point(100, visible=3)
    return job


def test_it_tells_of_jobs_slices_and_samples(http: httpx.Client, busy: StagedJob) -> None:
    before = Scrape(http)
    assert before.value("plateau_jobs", state="rendering") == 1
    assert before.value("plateau_slice_tries_total", outcome="committed") == 4
    assert before.value("plateau_slice_tries_total", outcome="died") == 1
    assert before.value("plateau_samples_rendered_total") == 100 * WIDTH * HEIGHT
    assert before.value("plateau_machine_seconds_total") == pytest.approx(4 * 0.5 + 0.2)
    assert before.value("plateau_samples_saved_total") == 0
    busy.end()
    after = Scrape(http)
    assert after.value("plateau_jobs", state="rendering") == 0
    assert after.value("plateau_jobs_ended_total", state="converged") == 1
    shown = http.get(f"/v1/jobs/{busy.id}").json()
    assert after.value("plateau_samples_saved_total") == shown["samples_saved"] > 0
    assert after.value("plateau_machine_seconds_total") == pytest.approx(shown["machine_s"])


def test_no_series_comes_twice_and_each_is_explained(http: httpx.Client, busy: StagedJob) -> None:
    scrape = Scrape(http)
    [build] = [key for key in scrape.samples if key[0] == "plateau_build_info"]
    assert {name for name, _ in build[1:]} == {"version", "python"}
    families = scrape.families
    samples = [
        (sample.name, *sorted(sample.labels.items()))
        for family in families
        for sample in family.samples
    ]
    assert len(samples) == len(set(samples))
    for family in families:
        assert family.name.startswith("plateau_")
        assert family.type in {"gauge", "counter", "histogram"}
        assert family.documentation.endswith(".")
    assert len({family.name for family in families}) == len(families)


class TestRequests:
    def test_are_counted_by_the_template_of_their_path(
        self, redis_url: str, store: Blobs, client: redis.Redis
    ) -> None:
        job = StagedJob(client)
        with live_http(redis_url, store) as http:
            for path in (f"/v1/jobs/{job.id}", "/v1/jobs/0123456789ab", "/v1/jobs/0123456789ac"):
                http.get(path)
            http.get("/secret/9137")
            http.get("/v1/batches/of%2Fnone")
            http.get("/v1/jobs", headers={"Host": "evil.example"})
            http.request("BREW", "/v1/jobs")
            http.head(f"/v1/jobs/{job.id}")
            # And one that fails by a bug; after it the server closes the connection
            client.xadd(keys.job(job.id, "curve"), {"point": "no JSON"})
            answer = http.get(f"/v1/jobs/{job.id}/curve", headers={"Connection": "close"})
            problem(answer, 500, "internal-error")
            scrape = Scrape(http)
            text = http.get("/metrics").text
        route = "/v1/jobs/{job_id}"
        counted = {key[1:]: n for key, n in scrape.samples.items() if key[0] == f"{LATENCY}_count"}
        assert counted == {
            (("method", "GET"), ("route", route), ("status", "2xx")): 1,
            (("method", "GET"), ("route", route), ("status", "4xx")): 2,
            (("method", "GET"), ("route", "none"), ("status", "4xx")): 2,
            (("method", "GET"), ("route", "/v1/batches/{name}"), ("status", "4xx")): 1,
            (("method", "other"), ("route", "/v1/jobs"), ("status", "4xx")): 1,
            (("method", "HEAD"), ("route", route), ("status", "2xx")): 1,
            (("method", "GET"), ("route", f"{route}/curve"), ("status", "5xx")): 1,
        }
        assert job.id not in text
        assert "9137" not in text
        lasted = scrape.value(f"{LATENCY}_sum", method="GET", route=route, status="2xx")
        assert lasted is not None
        assert 0 < lasted < 60

    def test_for_events_are_streams_and_have_no_latency(
        self, redis_url: str, store: Blobs, client: redis.Redis
    ) -> None:
        job = StagedJob(client)
        with live_http(redis_url, store) as http:
            with http.stream("GET", f"/v1/jobs/{job.id}/events") as answer:
                lines = answer.iter_lines()
                next(lines)
                during = Scrape(http)
            until(lambda: Scrape(http).value("plateau_http_event_streams") == 0)
            after = Scrape(http)
        assert during.value("plateau_http_event_streams") == 1
        assert "/events" not in str(after.samples.keys())


class TestDocs:
    def test_the_table_has_what_is_served(self, http: httpx.Client, busy: StagedJob) -> None:
        operations = (ROOT / "docs" / "operations.md").read_text()
        rows = re.findall(r"^\| `(plateau_\w+)` \| (\w+) \|", operations, re.MULTILINE)
        served = Scrape(http)
        types = {family.name: family.type for family in served.families}
        assert {name for name, _ in rows} == served.names()
        assert len(rows) == len(served.names())
        for name, kind in rows:
            assert types[name.removesuffix("_total") if kind == "counter" else name] == kind

    def test_the_dashboard_asks_for_what_is_served(
        self, http: httpx.Client, busy: StagedJob
    ) -> None:
        dashboard = json.loads((ROOT / "deploy" / "grafana" / "plateau.json").read_text())
        panels = [panel for panel in dashboard["panels"] if panel["type"] != "row"]
        asked = [target["expr"] for panel in panels for target in panel["targets"]]
        asked += [
            one["definition"] for one in dashboard["templating"]["list"] if one["type"] == "query"
        ]
        served = Scrape(http).series()
        for expression in asked:
            names = re.findall(r"plateau_\w+", expression)
            assert names or "up{" in expression
            assert set(names) <= served, expression

    def test_the_scrape_config_names_our_port(self) -> None:
        url = httpx.URL(Settings.model_fields["url"].default)
        config = (ROOT / "deploy" / "prometheus.yml").read_text()
        assert f'targets: ["localhost:{url.port}"]' in config
