"""Slices are independent, so that the merged error falls as 1/sqrt(n) (invariant 4).

Judged by `tests.support.images.independence` on the noise scene. The slices are the pure functions
that the farm's schedule makes of job seed 0, so a verdict never changes on one machine; over all
job seeds, independent slices would be found guilty once in 10,000 (the false failure rate below,
for each stack of slices, Bonferroni-corrected over its pairs and prefixes). What a failed test
judged is left in its temporary folder.

LLVM slices are held to exactly that. Scalar slices get an allowance, for a fault of Mitsuba's that
no choice of seeds can mend: in scalar variants every pixel and pass reads the same PCG32 stream,
and two passes keep one distance on it in all pixels, which leaves them faintly correlated. Over
job seeds, pairs of 1-spp slices had |r| up to 0.12 (0.016 at 16 spp), of either sign, and the
variance of merged slices was within 3 % of independence.

``LONG_TESTS=1`` judges more sizes, more slices and more samples; it takes some 15 minutes.
"""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from plateau.farm.model.seeds import Pass, SeedSchedule
from tests.support import long_tests
from tests.support.images.independence import Verdict, judge, leave_behind
from tests.support.processes.mitsuba_process import MitsubaProcess

NOISE = Path(__file__).parents[1] / "reference/scenes/noise"

FALSE_FAILURE_RATE = 1e-4

#: Of scalar variants, on top of the bounds of independence (see above).
ALLOWANCES: dict[str, dict[str, float]] = {
    "scalar_rgb": {"law_allowance": 0.03, "correlation_allowance": 0.15},
    "llvm_ad_rgb": {},
}

#: width, height, spp of a slice, slices. 3 spp make a slice of two passes.
SHORT = [(333, 255, 3, 8), *long_tests.rare((512, 512, 1, 32))]
LONG = [(512, 512, 16, 64), (333, 255, 1, 256), (640, 360, 4, 128), (40, 24, 25, 400)]
CASES = [*SHORT, *(LONG if long_tests.WANTED else [])]


class Bench:
    """Renders slices by a schedule, good or broken, and has them judged."""

    def __init__(self, mitsuba: MitsubaProcess, folder: Path) -> None:
        self._mitsuba = mitsuba
        self._folder = folder
        self._slices: np.ndarray = np.zeros(0)
        self._verdict: Verdict | None = None

    @property
    def variant(self) -> str:
        return self._mitsuba.variant

    def verdict(self, width: int, height: int, schedule: Iterable[tuple[Pass, ...]]) -> Verdict:
        self._mitsuba.load(NOISE, width=width, height=height)
        self._slices = np.stack([self._render(passes) for passes in schedule])
        self._verdict = judge(
            self._slices, false_failure_rate=FALSE_FAILURE_RATE, **ALLOWANCES[self.variant]
        )
        return self._verdict

    def _render(self, passes: tuple[Pass, ...]) -> np.ndarray:
        # The green channel; with a box filter all weights are the spp.
        films = [self._mitsuba.render_pass(*one)[..., 1] for one in passes]
        return sum(films) / sum(one.spp for one in passes)

    def leave_behind(self) -> None:
        if self._verdict is not None:
            leave_behind(self._slices, self._verdict, self._folder)


@contextmanager
def _bench(
    mitsuba: MitsubaProcess, folder: Path, request: pytest.FixtureRequest
) -> Iterator[Bench]:
    bench = Bench(mitsuba, folder)
    failed_before = request.session.testsfailed
    yield bench
    if request.session.testsfailed > failed_before:
        bench.leave_behind()


@pytest.fixture
def bench(mitsuba, tmp_path, request):
    with _bench(mitsuba, tmp_path, request) as bench:
        yield bench


@pytest.fixture
def scalar_bench(scalar, tmp_path, request):
    with _bench(scalar, tmp_path, request) as bench:
        yield bench


@pytest.mark.timeout(12_000 if long_tests.WANTED else 1200)
@pytest.mark.parametrize(("width", "height", "spp", "count"), CASES)
def test_slices_of_the_schedule_are_independent(bench, width, height, spp, count):
    schedule = SeedSchedule(bench.variant, width, height, spp, spp * count)
    verdict = bench.verdict(width, height, map(schedule.passes, range(count)))
    assert verdict.law_holds, verdict
    assert verdict.pairs_uncorrelated, verdict


# The same judgement must find broken schedules guilty.


def test_a_seed_that_is_not_applied_is_found(bench):
    # LuxCore's: every node renders the same noise
    verdict = bench.verdict(64, 64, [(Pass(1, 0),)] * 8)
    assert not verdict.law_holds
    assert not verdict.pairs_uncorrelated
    assert verdict.law[8] == pytest.approx(8)


def test_a_seed_that_the_32_bit_product_loses_is_found(scalar_bench):
    # 64 · 64 · 2**20 = 0 modulo 2**32
    verdict = scalar_bench.verdict(64, 64, [(Pass(1, index << 20),) for index in range(8)])
    assert not verdict.law_holds
    assert not verdict.pairs_uncorrelated


def test_a_slice_that_is_counted_twice_is_found(bench):
    # The ninth repeats the first: one pair of 36.
    verdict = bench.verdict(333, 255, [(Pass(1, index % 8),) for index in range(9)])
    assert not verdict.pairs_uncorrelated


@pytest.mark.long
def test_consecutive_scalar_seeds_are_found(scalar_bench):
    # No pair stands out; but all distances repeat, and what they leave adds up with every slice.
    verdict = scalar_bench.verdict(333, 255, [(Pass(1, index),) for index in range(64)])
    assert verdict.pairs_uncorrelated
    assert not verdict.law_holds
    assert verdict.law[64] > verdict.law[32] > verdict.law[16] > 1
