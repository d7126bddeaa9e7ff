"""``GET /metrics``: the whole farm in Prometheus's format, from any API process."""

import platform
from collections.abc import Iterator, Mapping
from functools import partial
from typing import Final

from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.core import (
    CounterMetricFamily,
    GaugeMetricFamily,
    InfoMetricFamily,
    Metric,
)
from prometheus_client.exposition import CONTENT_TYPE_PLAIN_0_0_4
from prometheus_client.registry import Collector

from plateau.farm.ledger.totals import Census, take_census
from plateau.farm.model import versions
from plateau.farm.redis.client import RedisClient
from plateau.service.api.metrics.requests import Requests

CONTENT_TYPE: Final = CONTENT_TYPE_PLAIN_0_0_4


class Metrics:
    """All metrics of one API process, in their own registry."""

    def __init__(self, client: RedisClient) -> None:
        self._registry = CollectorRegistry(auto_describe=False)
        self._registry.register(_Farm(client))
        self.requests = Requests(self._registry)

    def exposition(self) -> bytes:
        """The metrics as text of type `CONTENT_TYPE`; raises `StoreUnavailable`."""
        return generate_latest(self._registry)


class _Farm(Collector):
    """Counts the farm at each scrape."""

    def __init__(self, client: RedisClient) -> None:
        self._redis = client

    def collect(self) -> Iterator[Metric]:
        """Yield the farm's metrics."""
        census = take_census(self._redis)
        yield InfoMetricFamily(
            "plateau_build",
            "1; its labels say what this API process runs.",
            {"version": versions.plateau(), "python": platform.python_version()},
        )
        yield from _open_work(census)
        yield from _processes(census)
        yield from _totals(census)


def _open_work(census: Census) -> Iterator[Metric]:
    yield _gauge("plateau_jobs", "Jobs that have not ended, by state.", census.jobs, "state")
    yield _gauge(
        "plateau_jobs_unserved",
        "Jobs that wait or render without a living worker that takes work and has their variant, "
        "pool and tags; GET /v1/jobs says what they wait for.",
        len(census.unserved),
    )
    yield _gauge(
        "plateau_queue_age_seconds",
        "Age of the oldest job without a rendered slice, except paused ones; 0 without such a job. "
        "If it grows, the farm has too few workers.",
        census.queue_age_s,
    )
    yield _gauge(
        "plateau_slices",
        "Slices (full frames of some samples per pixel, each one worker's for a while) that wait "
        "for a worker, or are leased to one.",
        census.slices,
        "state",
    )
    yield _gauge(
        "plateau_notices_waiting",
        "Notices of ended jobs that wait for their first or next try.",
        census.notices_waiting,
    )


def _processes(census: Census) -> Iterator[Metric]:
    yield _gauge(
        "plateau_workers",
        "Workers that are alive, by what they do; out_of_service: it found that it can render "
        "nothing (GET /v1/workers says why).",
        census.workers,
        "state",
    )
    yield _gauge(
        "plateau_monitors",
        "Monitors that are alive: they merge slices and decide when a job has converged.",
        census.monitors,
    )
    yield _gauge(
        "plateau_jobs_owned",
        "Jobs that a living monitor takes care of; where it stays below the jobs that have not "
        "ended, monitors are missing.",
        census.jobs_owned,
    )
    if census.swept_at is not None:
        yield _gauge(
            "plateau_last_sweep_timestamp_seconds",
            "When a monitor last removed what nobody needs any more; once an hour, as a rule. "
            "Absent before the first time.",
            census.swept_at,
        )


def _totals(census: Census) -> Iterator[Metric]:
    yield _counter(
        "plateau_jobs_ended_total",
        "Jobs ended, by how: converged (a rule fired), exhausted (at its cap or time "
        "limit), cancelled or failed.",
        census.jobs_ended,
        "state",
    )
    yield _counter(
        "plateau_slice_tries_total",
        "Tries of slices, by how they ended; only committed ones count for an image. rejected: "
        "committed, but the partial was lost or damaged afterwards; late: the job had ended; "
        "lost: the worker fell silent.",
        census.tries,
        "outcome",
    )
    yield _counter(
        "plateau_samples_rendered_total",
        "Samples (not samples per pixel) in committed slices; its rate is the farm's speed.",
        census.samples,
    )
    yield _counter(
        "plateau_samples_saved_total",
        "Samples that converged jobs would have cost otherwise: what the farm exists for.",
        census.samples_saved,
    )
    yield _counter(
        "plateau_machine_seconds_total",
        "Seconds that render children spent on slices, whatever came of them.",
        census.machine_s,
    )
    yield _counter(
        "plateau_notice_tries_total",
        "Tries to deliver a notice of an ended job, by how they ended: delivered, failed (another "
        "follows) or given up.",
        census.notice_tries,
        "outcome",
    )


def _family(
    kind: type[GaugeMetricFamily | CounterMetricFamily],
    name: str,
    help_text: str,
    value: float | Mapping[str, float],
    label: str = "",
) -> Metric:
    """Gauges or counters: one value, or one for each value of a label."""
    family = kind(name, help_text, labels=(label,) if label else ())
    if not isinstance(value, Mapping):
        family.add_metric((), value)
        return family
    for name, number in value.items():
        family.add_metric((name,), number)
    return family


_gauge = partial(_family, GaugeMetricFamily)
_counter = partial(_family, CounterMetricFamily)
