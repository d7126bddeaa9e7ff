"""`plateau.map`: each image is that of its place alone, and one that fails stops no other."""

import json
from pathlib import Path

import numpy as np
import pytest

import plateau
from plateau import Mapped
from plateau.errors import CommandFailed
from tests.support.farms.real_farm import BOX, RealFarm

CHECKS = {"analytic": 1, "width": 40, "height": 30, "light": "checks", "level": 0.2}
SMALL = {"width": 24, "height": 16}


@pytest.fixture
def checks(tmp_path: Path) -> Path:
    path = tmp_path / "checks.json"
    path.write_text(json.dumps(CHECKS))
    return path


def test_an_image_and_its_inputs_are_those_of_a_job_alone(farm: RealFarm) -> None:
    values = [{**SMALL, "intensity": 5 + step} for step in range(8)]
    found = {
        one.index: one
        for one in plateau.map(
            BOX,
            iter(values),
            target="fixed:spp=24",
            inputs=[1, 4, 7],
            aovs=["depth"],
            farm=farm.url,
        )
    }
    assert sorted(found) == list(range(8))
    mapped = found[7]
    assert (mapped.parameters, mapped.image.shape) == (values[7], (16, 24, 3))
    # Alone, that job has the same bits; its pictures are of no account
    alone = {"parameters": values[7], "aovs": ["depth"], "seed": 7, "frame_seed": 7}
    alone |= {"inputs": (1, 4, 7), "slice_spp": 24, "step": 24, "allocation": "frame"}
    job = plateau.render(BOX, farm=farm.url, max_spp=24, rule="fixed:spp=24", **alone)  # type: ignore[arg-type]
    assert "image.png" in job.files
    assert {name for name in job.channels if not name.startswith("spp")} == set(mapped.channels)
    assert all(np.array_equal(one, job.channels[name]) for name, one in mapped.channels.items())
    plain = farm.client.submit(BOX, pictures=False, max_spp=24, rule="fixed", **alone)  # type: ignore[arg-type]
    farm.client.wait(plain.id)
    with pytest.raises(plateau.NoImageYet, match="was to make no pictures"):
        farm.client.image(plain.id, "image.png")
    # An input is the image of a job that ends there
    alone |= {"inputs": (1, 4), "slice_spp": 4, "step": 4}
    short = plateau.render(BOX, farm=farm.url, max_spp=4, rule="fixed:spp=4", **alone)  # type: ignore[arg-type]
    assert list(mapped.inputs) == [1, 4, 7]
    for name in ("R", "G", "B", "Z"):
        np.testing.assert_array_equal(mapped.inputs[4][name], short.channels[name], err_msg=name)
    assert not np.array_equal(mapped.inputs[1]["R"], mapped.inputs[4]["R"])
    # What was fetched is gone from the service
    assert {job.id for job in farm.client.all_jobs()}.isdisjoint(
        one.result.job.id for one in found.values() if one.result
    )


def test_inputs_may_be_independent_and_the_variance_is_without_bias(
    farm: RealFarm, checks: Path
) -> None:
    asked = {"target": "relmse:target=1", "inputs": [2, 8], "farm": farm.url, "ordered": True}
    plain, other = plateau.map([checks, checks], **asked, variance=True)  # type: ignore[arg-type]
    (apart,) = plateau.map(checks, **asked, independent=True)  # type: ignore[arg-type]
    assert not np.array_equal(apart.inputs[8]["R"], plain.inputs[8]["R"])
    # Of two images with samples of their own, the difference has twice the variance. It is known
    # to 3 % by 3,600 values with three degrees of freedom (seeds 0 and 1; never by chance).
    said = plain.errors["relmse"]
    assert said.low is not None
    assert said.value is not None
    assert said.low < said.value
    assert plain.variance is not None
    true = np.square(plain.image - other.image).mean() / 2
    assert plain.variance.mean() == pytest.approx(true, rel=0.15)
    assert apart.variance is None


def maker(level: float) -> dict[str, object]:
    raise ValueError(f"no scene of level {level}")


def test_one_that_fails_stops_no_other(farm: RealFarm, checks: Path) -> None:
    levels: list[dict[str, object]] = [{"level": one} for one in (0.1, "nope", 0.3)]
    found: list[Mapped] = list(
        plateau.map(
            [checks, maker, "gone.xml"], levels, target="fixed:spp=4", farm=farm.url, ordered=True
        )
    )
    assert [one.index for one in found] == list(range(9))
    assert [bool(one.failure) for one in found] == [False, True, False, *[True] * 6]
    assert "level" in found[1].failure
    assert "maker raised ValueError: no scene of level 0.1" in found[3].failure
    assert "gone.xml" in found[6].failure
    assert found[2].image.shape == (30, 40, 3)
    with pytest.raises(CommandFailed, match=r"image 6 \(gone\.xml\): "):
        _ = found[6].image
    assert list(plateau.map([], farm=farm.url)) == []
    with pytest.raises(plateau.InvalidSpec, match=r"inputs must rise"):
        plateau.map(checks, inputs=[4, 4])
    with pytest.raises(plateau.InvalidSpec, match="no inputs to be independent"):
        plateau.map(checks, independent=True)


def test_the_samples_of_zones_are_a_layer_and_no_input(farm: RealFarm, checks: Path) -> None:
    zones = {"allocation": "zones", "target": "fixed:spp=400"}
    [one] = plateau.map(checks, [SMALL], farm=farm.url, **zones)
    assert ("spp" in one.channels, one.inputs) == (True, {})
