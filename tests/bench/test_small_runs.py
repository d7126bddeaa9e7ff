"""The experiment in small: the farm renders once, then a scene is judged and timed."""

import pytest

from bench import savings
from bench.support import series
from bench.support.recordings import SCENES
from bench.support.series import Rendered, Series, Size
from plateau.farm.model.spec import (
    JobSpec,
    MultipleSpec,
    MyszkowskiSpec,
    ReverseSpec,
    SuccessiveSpec,
    VisibleSpec,
)
from plateau.picture.series import find_series, judge_series

BOX, SIZE = SCENES["BOX 1"], Size(pixels=24, cap=600)
pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def renders(tmp_path_factory: pytest.TempPathFactory) -> Rendered:
    return series.rendered(BOX, SIZE, tmp_path_factory.mktemp("data"), workers=1)


@pytest.fixture(scope="module")
def box(renders: Rendered) -> Series:
    return series.measure(renders)


def test_every_image_is_held_against_a_reference_of_other_samples(box: Series) -> None:
    assert box.spp == list(range(50, 601, 50))
    # Its own last image would be no different from itself.
    assert box.truth[0] > box.truth[-1] > 0


def test_it_stops_where_plateau_judge_does(box: Series, renders: Rendered) -> None:
    spec = JobSpec(
        step=100,
        rule=VisibleSpec(),
        watch=(ReverseSpec(), MultipleSpec(window=5), SuccessiveSpec(), MyszkowskiSpec()),
    )
    judged = judge_series(find_series(renders.slices, image_spp=None, cumulative=False), spec)
    names = {rule: rule for rule in ("reverse", "successive", "myszkowski", "visible")}
    for rule, name in {**names, "multiple": "multiple, window 5"}.items():
        stop = box.stops[f"{name} @100"]
        assert judged.stops[rule] == (stop.spp if stop.ended else None)


def test_rendering_and_looking_cost_something(renders: Rendered) -> None:
    looks = savings.look_costs(renders)
    assert {whose for _, whose in savings.RULES.values()} == set(looks)
    assert all(seconds > 0 for times in looks.values() for seconds in times)
