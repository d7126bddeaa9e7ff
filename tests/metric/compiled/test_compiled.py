"""The compiled predictor sees what the numpy one sees, and nothing else."""

import numpy as np
import pytest

from plateau.metric import View, VisibleDifferences
from plateau.metric.compiled import CompiledVisibleDifferences
from plateau.metric.compiled.levels import SLICE
from plateau.metric.compiled.predictor import COMPARISONS_BEFORE_KEEPING

#: The share of pixels in which the two may differ.
TOLERANCE = 1e-4


def noisy_pair(height, width, noise=0.05, seed=1989):
    """Two noisy images of one scene with edges, gradients, colour, and a black corner."""
    generator = np.random.default_rng(seed)
    y, x = np.mgrid[0 : 1 : height * 1j, 0 : 1 : width * 1j]
    checks = np.where((np.floor(9 * x) + np.floor(6 * y)) % 2 == 0, 0.8, 0.25)
    scene = np.stack([checks * x, checks * (1 - y), 0.5 * checks], axis=-1)
    scene[: height // 5, : width // 5] = 0
    return [
        (scene * (1 + noise * generator.standard_normal(scene.shape))).astype(np.float32)
        for _ in range(2)
    ]


def judged_by_both(view, reference, test):
    numpy, compiled = VisibleDifferences(view), CompiledVisibleDifferences(view)
    return tuple(
        metric.compare(metric.percept(reference), metric.percept(test))
        for metric in (numpy, compiled)
    )


def assert_equal(expected, found, tolerance=0.0):
    """The maps agree but for this share of the pixels, and the numbers go with the maps."""
    assert found.visible.dtype == bool
    assert np.count_nonzero(found.visible != expected.visible) <= tolerance * expected.visible.size
    assert found.count == np.count_nonzero(found.visible)
    assert found.fraction == found.count / found.visible.size
    assert found.non_finite == expected.non_finite


class TestBothSeeTheSame:
    @pytest.mark.parametrize("noise", [0.005, 0.02, 0.05, 0.2, 1.0])
    def test_on_weak_and_on_strong_noise(self, noise):
        expected, found = judged_by_both(View(), *noisy_pair(400, 500, noise))
        assert 0 < expected.fraction < 1
        assert_equal(expected, found, TOLERANCE)

    @pytest.mark.parametrize("exposure_ev", [-20, -16, -12, -9, -7, -4, 1, 3])
    def test_from_starlight_to_glare(self, exposure_ev):
        # Down to the luminances at which only rods see.
        view = View(exposure_ev=exposure_ev)
        expected, found = judged_by_both(view, *noisy_pair(400, 500, 0.5))
        assert_equal(expected, found, TOLERANCE)

    @pytest.mark.parametrize(
        "view",
        [
            View(white_luminance=1000),
            View(white_luminance=20),
            View(field_of_view_deg=15),
            View(field_of_view_deg=120),
            View(luminance_only=True),
            View(primaries="adobe1998"),
            View(gamma=2.2, exposure_ev=0.5),
        ],
        ids=repr,
    )
    def test_under_any_view(self, view):
        expected, found = judged_by_both(view, *noisy_pair(400, 500, 0.1))
        assert 0 < expected.fraction < 1
        assert_equal(expected, found, TOLERANCE)

    @pytest.mark.parametrize("height", [1, 2, 3, 4, 5, 16])
    @pytest.mark.parametrize("width", [1, 2, 3, 4, 5, SLICE - 1, SLICE, SLICE + 1, 2 * SLICE + 1])
    def test_on_any_size(self, height, width):
        assert_equal(*judged_by_both(View(), *noisy_pair(height, width, 0.1)))

    def test_on_radiance_beyond_what_float32_can_scale(self):
        extremes = np.float32([1e38, 3.4e38, -1e38, 1e-45, -0.0, 1.0])
        reference = np.tile(extremes, (16, 16, 3)).reshape(16, 32, 9)[..., :3]
        for view in (View(exposure_ev=100), View(exposure_ev=-100), View(gamma=2.2)):
            assert_equal(*judged_by_both(view, reference, reference[::-1, ::-1]))

    @pytest.mark.parametrize("dtype", [np.float16, np.float64])
    @pytest.mark.parametrize("order", ["C", "F"])
    def test_of_any_dtype_and_layout_writable_or_not(self, dtype, order):
        pair = [np.asarray(image, dtype, order=order) for image in noisy_pair(40, 50)]
        for image in pair:
            image.flags.writeable = False
        assert_equal(*judged_by_both(View(), *pair))
        assert_equal(*judged_by_both(View(), *(image[::2, ::-1] for image in pair)))


class TestNonFinitePixels:
    @pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
    @pytest.mark.parametrize("gamma", [1, 2.2])
    @pytest.mark.parametrize("which", ["reference", "test", "both"])
    def test_they_are_counted_and_visible_and_poison_nothing_else(self, value, gamma, which):
        reference, test = noisy_pair(50, 300, 0.1)
        for image, name in ((reference, "reference"), (test, "test")):
            if which in (name, "both"):
                image[20, 30, 1] = value
                image[0, 0] = value
                image[49, 299, 2] = value
        expected, found = judged_by_both(View(gamma=gamma), reference, test)
        assert_equal(expected, found)
        assert found.non_finite == 3
        assert found.visible[20, 30]

    def test_they_are_not_forgotten_when_the_percept_is_kept(self):
        reference, test = noisy_pair(50, 60)
        reference[3, 4] = np.nan
        metric = CompiledVisibleDifferences(View())
        kept = metric.percept(reference)
        kept.keep()
        assert metric.compare(kept, metric.percept(test)).non_finite == 1
        assert np.argwhere(kept.non_finite).tolist() == [[3, 4]]


class TestPercepts:
    @pytest.mark.parametrize("view", [View(), View(exposure_ev=-3, primaries="adobe1998")])
    @pytest.mark.parametrize("shape", [(1, 1), (2, 7), (7, 2), (70, 300)])
    def test_their_levels_have_the_same_bits(self, view, shape):
        image, _ = noisy_pair(*shape)
        expected, found = (
            predictor(view).percept(image)
            for predictor in (VisibleDifferences, CompiledVisibleDifferences)
        )
        assert np.array_equal(expected.levels, found.levels)
        np.testing.assert_allclose(found.chroma, expected.chroma, atol=3e-4)
        assert found.shape == expected.shape == shape

    def test_luminance_alone_needs_no_chroma(self):
        image, _ = noisy_pair(5, 5)
        assert CompiledVisibleDifferences(View(luminance_only=True)).percept(image).chroma is None

    def test_kept_and_streamed_ones_give_the_same_bits(self):
        reference, test = noisy_pair(90, 333)
        metric = CompiledVisibleDifferences(View())
        maps = []
        for keep_reference in (False, True):
            for keep_test in (False, True):
                percepts = metric.percept(reference), metric.percept(test)
                for percept, keep in zip(percepts, (keep_reference, keep_test), strict=True):
                    if keep:
                        percept.keep()
                maps.append(metric.compare(*percepts).visible)
                # Exchanging the two changes nothing, either.
                maps.append(metric.compare(*percepts[::-1]).visible)
        assert all(np.array_equal(one, maps[0]) for one in maps)

    def test_one_that_comes_up_often_is_kept_and_lets_go_of_its_image(self):
        reference, test = noisy_pair(20, 30)
        metric = CompiledVisibleDifferences(View())
        percept = metric.percept(reference)
        for _ in range(COMPARISONS_BEFORE_KEEPING):
            expected = metric.compare(percept, metric.percept(test))
            assert not percept.kept
        found = metric.compare(percept, metric.percept(test))
        assert percept.kept
        assert np.array_equal(expected.visible, found.visible)
        reference[:] = 0  # no longer looked at
        assert np.array_equal(
            expected.visible, metric.compare(percept, metric.percept(test)).visible
        )

    def test_one_can_be_compared_with_itself(self):
        metric = CompiledVisibleDifferences(View())
        percept = metric.percept(noisy_pair(20, 30)[0])
        for _ in range(COMPARISONS_BEFORE_KEEPING + 1):
            assert metric.compare(percept, percept).count == 0

    def test_the_images_given_are_left_alone(self):
        reference, test = noisy_pair(20, 30)
        test[0, 0] = np.nan
        before = test.copy()
        judged_by_both(View(gamma=2.2), reference, test)
        assert np.array_equal(before, test, equal_nan=True)


@pytest.mark.parametrize("predictor", [VisibleDifferences, CompiledVisibleDifferences])
def test_what_cannot_be_compared_is_refused(predictor):
    metric, far = predictor(View()), predictor(View(field_of_view_deg=20))
    image, tall = noisy_pair(4, 6)[0], noisy_pair(6, 4)[0]
    with pytest.raises(ValueError, match="6×4 and 4×6 pixels"):
        metric.compare(metric.percept(image), metric.percept(tall))
    with pytest.raises(ValueError, match="field_of_view_deg=20"):
        metric.compare(metric.percept(image), far.percept(image))
    with pytest.raises(ValueError, match=r"\(H, W, 3\)"):
        metric.percept(np.zeros((4, 4)))


def test_percepts_of_the_numpy_predictor_are_refused():
    image, _ = noisy_pair(4, 6)
    metric = CompiledVisibleDifferences(View())
    with pytest.raises(TypeError, match="PreparedPercept"):
        metric.compare(VisibleDifferences(View()).percept(image), metric.percept(image))
