"""Images that are rendered already are judged as a job's are."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from plateau.errors import CommandFailed
from plateau.farm.images.exr import Pixels, encode_partial
from plateau.farm.model.spec import JobSpec
from plateau.picture.series import CannotJudge, find_series, judge_series
from tests.support.farms.noise_farm import noise_film
from tests.support.images.plain_exr import encode_image, partial_of
from tests.support.processes.commands import plateau as command

SLICES = 40
SPEC = JobSpec.model_validate(
    {
        "step": 20,
        "slice_spp": 10,
        "max_spp": 4000,
        "rule": {"name": "reverse", "epsilon": 30},
        "watch": [{"name": "visible", "min_spp": 40}, {"name": "fixed", "spp": 100}],
    }
)


def partial(index: int, job_id: str = "j", film: Pixels | None = None) -> bytes:
    film = noise_film(index, 10, 0.5) if film is None else film
    return encode_partial(partial_of(film, index, job_id=job_id, spp=10))


@pytest.fixture
def slices(tmp_path: Path) -> Path:
    folder = tmp_path / "slices"
    folder.mkdir()
    for index in range(SLICES):
        (folder / f"slice-{index}.exr").write_bytes(partial(index))
    return folder


def test_kept_slices_are_judged_at_each_step(slices: Path) -> None:
    judged = judge_series(find_series(slices, image_spp=None, cumulative=False), SPEC)
    assert [point.spp for point in judged.points] == list(range(20, 401, 20))
    assert judged.stops["fixed"] == 100
    assert judged.stops["reverse"] is not None
    assert judged.points[-1].estimate_pixels is not None
    assert (judged.width, judged.height) == (32, 24)


def test_copies_of_one_image_are_no_series(tmp_path: Path) -> None:
    image = encode_image(noise_film(0, 10, 0.5)[..., :3] / 10)
    for index in range(SLICES):
        (tmp_path / f"{index}.exr").write_bytes(image)
    with pytest.raises(CommandFailed, match=r"0.exr and .*1.exr have the same noise"):
        judge_series(find_series(tmp_path, image_spp=10, cumulative=False), SPEC)


def test_images_and_cumulative_images_judge_as_their_slices_do(
    slices: Path, tmp_path: Path
) -> None:
    expected = judge_series(find_series(slices, image_spp=None, cumulative=False), SPEC)
    for cumulative in (False, True):
        folder = tmp_path / f"cumulative-{cumulative}"
        folder.mkdir()
        total = np.zeros(())
        for index in range(SLICES):
            colour = noise_film(index, 10, 0.5)[..., :3].astype(np.float64) / 10
            total = total + colour
            image = total / (index + 1) if cumulative else colour
            (folder / f"{index}.exr").write_bytes(encode_image(image.astype(np.float32)))
        judged = judge_series(find_series(folder, image_spp=10, cumulative=cumulative), SPEC)
        assert judged.stops == expected.stops
        counts = [point.visible_pixels for point in judged.points]
        np.testing.assert_allclose(
            counts, [point.visible_pixels for point in expected.points], atol=2
        )


def test_what_cannot_be_judged_is_said(slices: Path, tmp_path: Path) -> None:
    def find(folder: Path) -> None:
        find_series(folder, image_spp=None, cumulative=False)

    with pytest.raises(CannotJudge, match=r"no \.exr files"):
        find(tmp_path)
    (slices / "slice-7.exr").rename(tmp_path / "gone")
    with pytest.raises(CannotJudge, match="lacks slice 7"):
        find(slices)
    (slices / "slice-7.exr").write_bytes(partial(7, "other"))
    with pytest.raises(CannotJudge, match="of job other"):
        find(slices)
    image = tmp_path / "images"
    image.mkdir()
    (image / "a.exr").write_bytes(encode_image(np.zeros((4, 4, 3), np.float32)))
    with pytest.raises(CannotJudge, match="--slice-spp"):
        find(image)
    with pytest.raises(CannotJudge, match="before the first evaluation"):
        judge_series(find_series(image, image_spp=10, cumulative=False), SPEC)
    (image / "b.exr").write_bytes(encode_image(np.zeros((5, 4, 3), np.float32)))
    with pytest.raises(CannotJudge, match=r"b\.exr: slice 1 is 4×5"):
        judge_series(find_series(image, image_spp=10, cumulative=False), SPEC)


def judge(*arguments: str) -> tuple[int, str, str]:
    """The command, with the rules of `SPEC`."""
    rules = ("--rule", "reverse:epsilon=30", "--watch", "visible:min_spp=40")
    steps = ("--step", "20", "--slice-spp", "10", "--max-spp", "4000")
    return command("judge", *arguments, *rules, "--watch", "fixed:spp=100", *steps)


def test_the_command_prints_and_writes(slices: Path, tmp_path: Path) -> None:
    code, words, _ = judge(str(slices), "-o", str(tmp_path / "out"))
    assert code == 0
    assert "20 evaluations of 32×24 pixels, to 400 spp" in words
    assert "would have stopped at 100 spp" in words
    assert "fixed would stop" in (tmp_path / "out" / "curve.svg").read_text()
    rows = (tmp_path / "out" / "curve.csv").read_text().splitlines()
    assert len(rows) == 21
    code, words, _ = judge(str(slices), "--json")
    assert (code, json.loads(words)["stops"]["fixed"]) == (0, 100)


def test_a_series_of_broken_images_is_not_judged(slices: Path, tmp_path: Path) -> None:
    # Given slices of which the third breaks more pixels than may be left out
    film = noise_film(2, 10, 0.5)
    film[0, :3, 0] = np.nan
    (slices / "slice-2.exr").write_bytes(partial(2, film=film))
    # Then no rule is told of it, and the picture shows where
    code, _, said = judge(str(slices), "-o", str(tmp_path / "out"))
    assert code == 1
    assert re.search(r"slice-3.exr: at 40 spp 3 of 768 pixels .* are NaN", said)
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["non-finite.png"]
    code, _, said = judge(str(slices))
    assert (code, "-o DIR writes non-finite.png there" in said) == (1, True)


def test_a_judgement_is_not_laid_over_a_jobs_own_curve(slices: Path, tmp_path: Path) -> None:
    # Given the folder of a job, as `plateau fetch` leaves it
    (tmp_path / ".plateau-job").write_text("0123456789ab\n")
    (tmp_path / "curve.csv").write_text("the job's own")
    code, _, said = judge(str(slices), "-o", str(tmp_path))
    assert (code, "the results and the curve of job 0123456789ab" in said) == (1, True)
    assert (tmp_path / "curve.csv").read_text() == "the job's own"
