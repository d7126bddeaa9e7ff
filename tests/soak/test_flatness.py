"""Whether a soak's judgement of memory finds what grows, and nothing else."""

import random

import pytest

from tests.soak.flatness import trend
from tests.soak.held import MEASURED, MOST_BYTES, MOST_COUNT, Held, Watch

MB = 1_000_000
#: Of a run of two hours.
SAMPLES, EVERY_MIN = 360, 1 / 3


def watch_of(own, descriptors=lambda _: 40) -> Watch:
    """A watch of a process whose memory in bytes, and whose descriptors, are so by the minute."""
    watch, noise = Watch(), random.Random(1)
    for place in range(SAMPLES):
        minute = place * EVERY_MIN
        held = {**dict.fromkeys(MEASURED, 0), "descriptors": descriptors(minute)}
        held["own"] = round(own(minute) + noise.gauss(0, 2 * MB))
        watch.times.setdefault("monitor", []).append(minute)
        watch.series.setdefault("monitor", []).append(Held(**held))
    return watch


@pytest.mark.parametrize(
    "own",
    [
        lambda _: 100 * MB,
        # Caches that fill in the first half hour
        lambda minute: (100 + 2 * min(minute, 30)) * MB,
        # Peaks while a large image is judged, and a restart
        lambda minute: (100 + 80 * (minute % 10 < 2)) * MB,
        lambda minute: (120 if minute < 70 else 90) * MB,
    ],
    ids=["flat", "warm-up", "peaks", "a restart"],
)
def test_what_does_not_grow_is_flat(own) -> None:
    assert watch_of(own).findings() == []


@pytest.mark.parametrize(
    "own",
    [
        # 150 kB a minute: 12 MB in the 80 minutes after the warm-up
        lambda minute: 100 * MB + 150_000 * minute,
        # The same between peaks, and hidden by a restart's drop
        lambda minute: 100 * MB + 150_000 * minute + 50 * MB * (minute % 10 < 2),
        lambda minute: 100 * MB + 400_000 * (minute % 60),
    ],
    ids=["a leak", "among peaks", "a leak and a restart"],
)
def test_a_leak_is_found(own) -> None:
    (finding,) = watch_of(own).findings()
    assert finding.startswith("monitor: own grew by")


def test_descriptors_that_stay_open_are_found() -> None:
    (finding,) = watch_of(lambda _: 100 * MB, lambda minute: 40 + int(minute) // 4).findings()
    assert finding == "monitor: descriptors grew by 20 from 54"
    assert watch_of(lambda _: 100 * MB, lambda m: 40 + int(m) % MOST_COUNT).findings() == []


def test_a_trend_is_that_of_the_time_after_the_warm_up() -> None:
    found = trend(range(91), [min(minute, 30) + minute / 10 for minute in range(91)])
    assert (found.start, found.middle, found.end) == pytest.approx((4.95, 34.5, 38.55))
    assert found.growth == pytest.approx(6)
    assert MOST_BYTES < 12 * MB
