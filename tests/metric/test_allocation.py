"""The next samples go where they take away most of what is still visible."""

import numpy as np
import pytest

from plateau.metric import Half, View
from plateau.metric.allocation import LARGE_ROUNDS, LEAST_SHARE, SMALL_ROUNDS, plan_round
from plateau.metric.compiled import CompiledVisibleDifferences
from plateau.metric.estimate import estimate_from
from plateau.metric.noise_model import noise_model
from plateau.metric.quality_allocation import plan_by_quality
from tests.support.images import PAPER

METRIC = CompiledVisibleDifferences(PAPER)
GREY, SIZE = np.float32(0.4), 16
TARGET, QUALITY, NEAR = 0.0005, 9.9, View(white_luminance=100, ambient_lux=64)
EITHER = pytest.mark.parametrize("target", [TARGET, QUALITY], ids=["noise", "quality"])


class Film:
    """A grey film whose pixels have normal noise: the noise of one sample is given for each."""

    def __init__(self, sigma, seed):
        self.sigma, self.rng = sigma, np.random.default_rng(seed)
        rows, columns = (-(-pixels // SIZE) for pixels in sigma.shape)
        self.spp = np.zeros((rows, columns), np.int64)
        self.sums = np.zeros((2, *sigma.shape, 3))

    def add(self, zones, spp):
        chosen = self.of_pixels(zones)[..., np.newaxis]
        noise = self.rng.normal(0, np.sqrt(spp / 2), self.sums.shape) * self.sigma[..., np.newaxis]
        self.sums += chosen * (noise + GREY * spp / 2)
        self.spp += zones * spp

    def of_pixels(self, zones):
        height, width = self.sigma.shape
        return zones.repeat(SIZE, axis=0).repeat(SIZE, axis=1)[:height, :width]

    def judged(self):
        halves = self.sums / self.of_pixels(self.spp)[..., np.newaxis] * 2
        even, odd = halves.astype(np.float32)
        model = noise_model(METRIC, (even + odd) / 2, (Half(even, 50), Half(odd, 50)))
        clean = METRIC.percept(model.clean)
        return model, clean, estimate_from(METRIC, model, clean)

    def plan(self, target=TARGET, planned=None, sizes=SMALL_ROUNDS):
        """Plan a round by the noise left, or by a quality in JOD."""
        planned = self.spp if planned is None else planned
        zones = {"spp": self.spp, "planned": planned, "size": SIZE, "sizes": sizes}
        if target >= 1:
            return plan_by_quality(self.judged()[0], NEAR, target, **zones)
        return plan_round(METRIC, *self.judged(), target, **zones)

    @property
    def mean(self):
        return float(self.of_pixels(self.spp).mean())


def film(sigma, spp=100, seed=1):
    one = Film(sigma, seed)
    one.add(np.ones_like(one.spp, bool), spp)
    return one


@pytest.fixture
def uneven():
    """A film with a noisy quarter."""
    sigma = np.full((64, 64), 0.05)
    sigma[:32, 32:] = 0.2
    return sigma


@EITHER
def test_the_noisy_zones_are_the_round(uneven, target):
    plan = film(uneven, 400).plan(target)
    assert plan.zones[:2, 2:].any()
    assert not plan.zones[:, :2].any()
    assert not plan.zones[2:].any()
    assert plan.needed[:2, 2:].min() > (3 if target < 1 else 1.1) * plan.needed[2:].max()


@EITHER
def test_a_plan_depends_on_its_arguments_alone(uneven, target):
    one = film(uneven)
    spp = one.spp.copy()
    first, second = one.plan(target), one.plan(target)
    assert (one.spp == spp).all()
    assert (first.zones == second.zones).all()
    assert (first.needed == second.needed).all()
    assert first.spp == second.spp


@pytest.mark.parametrize("sizes", [SMALL_ROUNDS, LARGE_ROUNDS])
def test_a_round_is_neither_tiny_nor_huge(uneven, sizes):
    one = film(uneven, 200)
    for target in (1e-4, 1e-3, 1e-2, 0.9, 1.0, 9.5, 9.99, 10.0):
        plan = one.plan(target, sizes=sizes)
        samples = plan.spp * one.of_pixels(plan.zones).mean()
        assert samples >= max(sizes.least * one.mean, 1)
        assert samples <= sizes.largest * one.mean * 1.5  # the last zone may be more than is left


@EITHER
def test_samples_in_flight_are_counted(uneven, target):
    one = film(uneven)
    before = one.plan(target)
    flying = one.spp + before.zones * 10_000
    after = one.plan(target, flying)
    assert not (before.zones & after.zones).any()
    assert (after.needed >= flying).all()
    assert after.needed.mean() > 1.024 * flying.mean()


def test_what_is_needed_is_enough(uneven):
    one = film(uneven, seed=3)
    needed = np.ceil(one.plan().needed).astype(np.int64)
    truth = METRIC.percept(np.full((64, 64, 3), GREY))
    counts = []
    for seed in range(20):
        other = Film(uneven, seed)
        other.spp = needed
        each = uneven / np.sqrt(other.of_pixels(needed))
        noise = other.rng.normal(0, 1, (64, 64, 3)) * each[..., np.newaxis]
        counts.append(METRIC.compare(truth, METRIC.percept(GREY + noise)).count)
    assert np.mean(counts) == pytest.approx(TARGET * 64 * 64, abs=1.5)


@EITHER
def test_an_image_without_noise_still_gets_a_round(target):
    plan = film(np.zeros((64, 64))).plan(target)
    assert plan.zones.any()
    assert plan.spp >= 1


def test_a_zone_is_never_forgotten():
    one = film(np.full((64, 64), 0.2))
    ahead = one.spp * 100
    ahead[2, 2] = 100
    plan = one.plan(planned=ahead)
    assert plan.needed[2, 2] >= LEAST_SHARE * plan.needed.mean() > ahead[2, 2]
    assert plan.zones[2, 2]


def test_a_new_firefly_opens_a_zone_again(uneven):
    one = film(uneven, 400)
    assert not one.plan().zones[3, 0]
    one.sums[0, 50:52, 4:6] += 2 * 200
    assert one.plan().needed[3, 0] > 2 * 400


@EITHER
def test_zones_at_the_edges_are_smaller(target):
    sigma = np.full((40, 56), 0.1)
    sigma[32:, 48:] = 0.5
    plan = film(sigma).plan(target)
    assert plan.zones.shape == (3, 4)
    assert plan.zones[2, 3]
    assert plan.needed[2, 3] == plan.needed.max()


def test_a_film_needs_fewer_samples_by_zones_than_whole(uneven):
    def spent(by_zones):
        """Return the mean spp at which the target is reached, with a round always in flight."""
        one = film(uneven, seed=11)
        flying = (np.ones_like(one.spp, bool), 100)
        while one.judged()[2].pixels > TARGET * 64 * 64:
            plan = one.plan(planned=one.spp + flying[0] * flying[1]) if by_zones else None
            one.add(*flying)
            flying = (plan.zones, plan.spp) if plan else (np.ones_like(one.spp, bool), 100)
        return one.mean

    assert spent(by_zones=True) < 0.6 * spent(by_zones=False)


def test_what_does_not_fit_is_refused(uneven):
    one = film(uneven)
    with pytest.raises(ValueError, match="target"):
        one.plan(0)
    for target in (TARGET, QUALITY):
        with pytest.raises(ValueError, match="zones"):
            one.plan(target, np.ones((2, 2), np.int64))
