"""The error that a rule reports is that against the truth, which it never sees.

Renders of a known image with known noise: normal, smeared by a filter, with heavy tails, and with
fireflies. Seeds are fixed, so that no verdict changes. The short form takes 24 renders of each;
``LONG_TESTS=1`` takes the 400 of docs/science/stopping.md.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from plateau.metric import Evidence, View, VisibleDifferences, create_rule
from plateau.metric.display import displayed, srgb_encoded
from plateau.metric.rules.error import ErrorRule
from plateau.metric.standard_error import Quarters
from tests.support.long_tests import WANTED

Floats = NDArray[Any]
METRIC = VisibleDifferences(View())
RUNS = 400 if WANTED else 24
#: Of 24 runs, fewer than 18 are held by intervals of 95 % once in 10,000 times.
FEWEST = 0.93 if WANTED else 18 / 24
MEASURES = ["relmse", "rmse", "psnr"]


def picture(side: int) -> Floats:
    """A ramp, another one and waves: from black to above white."""
    y, x = np.mgrid[:side, :side] / side
    waves = 0.05 + 0.4 * (np.sin(9 * x) * np.sin(7 * y) + 1)
    return np.stack([0.02 + 1.3 * x, 0.1 + 0.5 * y, waves], axis=-1)


def normal(rng: Any, side: int, spp: int) -> Floats:
    """Four quarters of so many samples a pixel, with noise that differs over the image."""
    size = picture(side) * np.linspace(0.1, 0.6, side)[:, np.newaxis, np.newaxis]
    common, own = rng.normal(size=(4, side, side, 1)), rng.normal(size=(4, side, side, 3))
    return picture(side) + size * (0.8 * common + 0.6 * own) / spp**0.5


def filtered(rng: Any, side: int, spp: int) -> Floats:
    noise = normal(rng, side, spp) - picture(side)
    for axis in (1, 2):
        noise = (np.roll(noise, 1, axis) + 2 * noise + np.roll(noise, -1, axis)) / 4
    return picture(side) + noise / 0.375


def heavy(rng: Any, side: int, spp: int) -> Floats:
    """One sample in fifty has 30 % of the light, as hits of which one is ten times another."""
    hits = rng.binomial(spp, 0.02, (4, side, side, 1))
    light = np.where(hits, rng.gamma(np.maximum(0.5 * hits, 0.1), 2), 0) / (0.02 * spp)
    return np.asarray((normal(rng, side, spp) - 0.3 * picture(side)) + 0.3 * picture(side) * light)


def fireflies(rng: Any, side: int, spp: int) -> Floats:
    """One sample in 100,000 has 1 % of the light, with a tail of infinite third moment."""
    hits = rng.binomial(spp, 1e-5, (4, side, side, 1))
    light = hits * (rng.pareto(2.5, hits.shape) + 1) / (spp * 1e-5 / 0.6)
    return np.asarray(normal(rng, side, spp) + 0.01 * picture(side) * (light - 1))


def evidence(quarters: Floats, spp: int, slices: int = 1) -> Evidence:
    means = [quarter.astype(np.float32) for quarter in quarters]
    image = quarters.mean(axis=0).astype(np.float32)
    return Evidence(spp, image, None, METRIC, quarters=Quarters(means, [slices] * 4, lambda x: x))


def shown(image: Floats) -> Floats:
    return srgb_encoded(displayed(image.astype(np.float32), METRIC.view))


def true_error(measure: str, image: Floats) -> float:
    truth = picture(len(image))
    squares: dict[str, Callable[[], Floats]] = {
        "relmse": lambda: (image - truth) ** 2 / (truth**2 + 0.01),
        "rmse": lambda: (image - truth) ** 2,
        "psnr": lambda: (shown(image) - shown(truth)) ** 2,
    }
    mean = float(squares[measure]().mean())
    return {"relmse": mean, "rmse": mean**0.5, "psnr": -10 * float(np.log10(mean))}[measure]


def rule_for(measure: str, **parameters: float) -> ErrorRule:
    rule = create_rule(measure, **parameters)
    assert isinstance(rule, ErrorRule)
    return rule


def covered(measure: str, render: Any, spp: int, runs: int = RUNS) -> tuple[float, float]:
    """The share of intervals that hold the truth, and the mean of reported over true errors."""
    held, ratios = 0, []
    for seed in range(runs):
        quarters = render(np.random.default_rng(seed), 96, spp)
        said = rule_for(measure).judge(evidence(quarters, 4 * spp)).numbers
        true = true_error(measure, quarters.mean(axis=0))
        low, high, value = said["low"], said["high"], said["value"]
        assert low is not None and high is not None and value is not None  # noqa: PT018
        held += low <= true <= high
        ratios.append(value / true)
    return held / runs, float(np.mean(ratios))


@pytest.mark.parametrize("measure", MEASURES)
@pytest.mark.parametrize("render", [normal, filtered, heavy, fireflies])
def test_the_interval_holds_the_truth(measure: str, render: Any) -> None:
    share, ratio = covered(measure, render, 256)
    assert share >= FEWEST
    assert ratio == pytest.approx(1, abs=0.02)


def stopped(measure: str, render: Any, target: float, runs: int = RUNS) -> Floats:
    """Where jobs of 32² pixels stop that look every 20 spp: reported and true error, and light."""
    found = []
    for seed in range(runs):
        rng, rule = np.random.default_rng(seed), rule_for(measure, target=target, min_spp=1)
        sums, slices, verdict = np.zeros((4, 32, 32, 3)), 0, None
        while verdict is None or not verdict.stop:
            sums, slices = sums + render(rng, 32, 5), slices + 1
            verdict = rule.judge(evidence(sums / slices, 20 * slices, slices))
        assert verdict.value is not None
        image = sums.sum(axis=0) / (4 * slices)
        light = image.mean() / picture(32).mean() - 1
        found.append((verdict.value, true_error(measure, image), light))
    return np.array(found)


@pytest.mark.parametrize(
    ("measure", "render", "target"),
    [("rmse", normal, 0.015), ("relmse", normal, 0.001), ("rmse", heavy, 0.1)],
)
def test_who_stops_by_it_reports_no_lucky_error(measure: str, render: Any, target: float) -> None:
    reported, true, _ = stopped(measure, render, target).T
    doubt = 0 if WANTED else 3 * (reported / true).std() / RUNS**0.5
    assert abs((reported / true).mean() - 1) < 0.02 + doubt
    assert (true <= target).mean() >= 0.93


@pytest.mark.parametrize("alike", [True, False])
def test_noise_is_that_of_most_tiles(alike: bool) -> None:
    held, ratios, sure = 0, [], 0
    for seed in range(RUNS):
        rng = np.random.default_rng(seed)
        size = 0.02 if alike else 0.02 * rng.lognormal(0, 0.5, (16, 16)).repeat(8, 0).repeat(8, 1)
        noise = np.reshape(size, (*np.shape(size), 1)) * rng.normal(size=(4, 128, 128, 3))
        said = rule_for("noise").judge(evidence(0.4 + noise, 1024)).numbers
        squares = np.square(noise.mean(axis=0)).mean(axis=-1) / 0.17
        true = np.quantile(squares.reshape(16, 8, 16, 8).mean(axis=(1, 3)), 0.95) ** 0.5
        low, high, value = said["low"], said["high"], said["value"]
        assert low is not None and high is not None and value is not None  # noqa: PT018
        held += low <= true <= high
        sure += true <= said["sure"]
        ratios.append(value / true)
    assert min(held, sure) >= FEWEST * RUNS
    assert np.mean(ratios) == pytest.approx(1, abs=0.01 if alike else 0.03)
