"""Copies of one render are told from renders with samples of their own."""

import numpy as np
import pytest

from plateau.picture.independence import Independence, NotIndependent

SIZE = 48, 64
BOARD = np.indices(SIZE).sum(axis=0)[..., np.newaxis] % 8 / 8  #: texture without noise


def render(seed: int, noise: float = 0.1, texture: float = 0.5) -> np.ndarray:
    drawn = np.random.default_rng(seed).normal(0, noise, (*SIZE, 3))
    return (1 + texture * BOARD + drawn).astype(np.float32)


def add(*images: np.ndarray) -> None:
    series = Independence()
    for number, image in enumerate(images):
        series.add(f"{number}.exr", image, None)


@pytest.mark.parametrize("noise", [0.3, 0.1, 0.01, 0.005])
@pytest.mark.parametrize("texture", [0.0, 0.2])
def test_renders_of_their_own_pass_however_little_noise_is_left(noise, texture):
    add(*(render(seed, noise, texture) for seed in range(5)))


@pytest.mark.parametrize("texture", [0.0, 0.5])
@pytest.mark.parametrize(
    "again",
    [
        lambda image: image,
        lambda image: np.nextafter(image, np.float32(np.inf)),
        lambda image: image.astype(np.float16).astype(np.float32),
        lambda image: np.where(np.arange(SIZE[1])[:, None] == 3, np.float32(np.nan), image),
    ],
    ids=["the same", "other last bits", "rounded to half", "with NaN"],
)
def test_one_seed_twice_is_refused(texture, again):
    first, other = render(1, texture=texture), render(2, texture=texture)
    with pytest.raises(NotIndependent, match=r"^0.exr and 2.exr have the same noise.*seed of"):
        add(first, other, again(first))


def test_what_has_no_noise_tells_nothing():
    flat = np.ones((*SIZE, 3), np.float32)
    add(flat, flat, flat)
    dot = np.zeros((1, 1, 3), np.float32)
    add(dot, dot)


def test_two_images_of_one_job_are_refused():
    series = Independence()
    series.add("a.exr", render(1), "0123456789ab")
    with pytest.raises(NotIndependent, match=r"a.exr and b.exr are both of job 0123456789ab"):
        series.add("b.exr", render(2), "0123456789ab")
