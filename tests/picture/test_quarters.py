"""A merge keeps four parts of the slices where a rule asks for them."""

import numpy as np
import pytest

from plateau.farm.model.errors import InvalidSpec
from plateau.farm.model.spec import JobSpec
from plateau.picture.merge import Merge

SPEC = JobSpec(rule={"name": "relmse"}, slice_spp=2, step=2)


def film(index: int) -> np.ndarray:
    light = np.random.default_rng(index).uniform(0, 4, (4, 5, 4)).astype(np.float32)
    light[..., 3] = 2
    return light


@pytest.mark.parametrize("slices", [4, 7, 9])
def test_each_quarter_has_every_fourth_slice_also_after_a_checkpoint(slices: int) -> None:
    merge = Merge.of(SPEC)
    for index in range(slices):
        merge.add(film(index))
        again = Merge.of(SPEC)
        again.restore(merge.slices, merge.arrays(), merge.about())
        merge = again
    quarters = merge.quarters()
    assert quarters is not None
    for part, mean in enumerate(quarters.means):
        own = [film(index)[..., :3] / 2 for index in range(part, slices, 4)]
        np.testing.assert_allclose(mean, np.mean(own, axis=0), rtol=1e-5)
        assert quarters.slices[part] == len(own)


def test_there_are_none_of_three_slices_nor_where_no_rule_asks() -> None:
    asked, other = Merge.of(SPEC), Merge.of(JobSpec())
    for index in range(3):
        asked.add(film(index))
    for index in range(8):
        other.add(film(index))
    assert asked.quarters() is None
    assert other.quarters() is None
    # Nor does a job keep those of the job that it continues
    asked.add(film(3))
    other.restore(4, asked.arrays(), asked.about())
    assert other.arrays().keys() == {"total", "even"}


@pytest.mark.parametrize("how", [{"allocation": {"name": "zones"}}, {"denoise": {"name": "oidn"}}])
@pytest.mark.parametrize("where", ["rule", "watch"])
def test_an_error_is_known_of_whole_frames_as_rendered(how: dict[str, object], where: str) -> None:
    rule = {"name": "psnr"}
    with pytest.raises(InvalidSpec, match="choose the allocation frame and no denoiser"):
        JobSpec(**how, **{where: rule if where == "rule" else [rule]})
