"""The forms in which metrics are handed to prometheus_client."""

from collections.abc import Mapping, Sequence
from math import isinf

from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, HistogramMetricFamily

from plateau.farm.model.durations import Histogram


def gauge(
    name: str, help_text: str, value: float | Mapping[str, float], label: str = ""
) -> GaugeMetricFamily:
    """A gauge: one value, or one for each value of a label."""
    family = GaugeMetricFamily(name, help_text, labels=(label,) if label else ())
    for labels, number in _samples(value):
        family.add_metric(labels, number)
    return family


def counter(
    name: str, help_text: str, value: float | Mapping[str, float], label: str = ""
) -> CounterMetricFamily:
    """A counter, its name with ``_total``: one value, or one for each value of a label."""
    family = CounterMetricFamily(name, help_text, labels=(label,) if label else ())
    for labels, number in _samples(value):
        family.add_metric(labels, number)
    return family


def add_histogram(
    family: HistogramMetricFamily, labels: Sequence[str], noted: Histogram
) -> HistogramMetricFamily:
    """The family, with a histogram under these labels."""
    buckets = [
        ("+Inf" if isinf(bound_s) else repr(bound_s), float(runs))
        for bound_s, runs in noted.buckets
    ]
    family.add_metric(labels, buckets, noted.sum_s)
    return family


def _samples(value: float | Mapping[str, float]) -> list[tuple[tuple[str, ...], float]]:
    if isinstance(value, Mapping):
        return [((name,), number) for name, number in value.items()]
    return [((), value)]
