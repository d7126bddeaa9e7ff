"""A job is judged as light: how the signal of a display is encoded hardly changes its quality."""

import numpy as np
import pytest

from plateau.metric.cvvdp import ColorVideoVDP, Display
from tests.support.images import quality_goldens

#: HLG's weights of light, and the constants of its curve (ITU-R BT.2100).
LIGHT = np.array([0.2627, 0.6780, 0.0593])
A = 0.17883277
B, C = 1 - 4 * A, 0.5 - A * np.log(4 * A)

DARK_ROOM = {"black": 0.001, "ambient_lux": 10, "primaries": "rec2020"}
DISPLAYS = {
    "srgb": {"peak": 200, "black": 0.2, "ambient_lux": 250},
    "pq": {"peak": 1000, **DARK_ROOM},
    "hlg": {"peak": 1000, **DARK_ROOM},
}
BITS = {"srgb": 8, "pq": 10, "hlg": 10}


def srgb(light, _peak):
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def pq(light, peak):
    """SMPTE ST 2084."""
    y = (light * peak / 10_000) ** 0.1593017578125
    return ((0.8359375 + 18.8515625 * y) / (1 + 18.6875 * y)) ** 78.84375


def hlg(light, _peak, gamma=1.2):
    scene = light * (light @ LIGHT)[..., None] ** (1 / gamma - 1)
    return np.where(
        scene <= 1 / 12, np.sqrt(3 * scene), A * np.log(np.maximum(12 * scene - B, 1e-9)) + C
    )


SIGNALS = {"srgb": srgb, "pq": pq, "hlg": hlg}


def noisy(scene):
    """Return linear light without and with noise, of colours that each signal can carry."""
    rng = np.random.default_rng(5)
    clean = 0.5 * np.clip(quality_goldens.made(scene, 96, 128, rng), 0, 1) ** 2.2 + 1e-6
    clean = 0.4 * clean.mean(axis=-1, keepdims=True) + 0.6 * clean
    noise = 0.05 * rng.standard_normal(clean.shape) * np.sqrt(clean / 10 + 1e-4)
    return clean, np.clip(clean + noise, 1e-6, 1)


@pytest.mark.parametrize("pixels_per_degree", [5.7, 38])
@pytest.mark.parametrize("transfer", SIGNALS)
@pytest.mark.parametrize("scene", quality_goldens.SCENES)
def test_the_signal_of_a_display_changes_little(scene, transfer, pixels_per_degree):
    screen = {"pixels_per_degree": pixels_per_degree, **DISPLAYS[transfer]}

    def quality(how, images):
        model = ColorVideoVDP(Display(transfer=how, **screen))
        return model.compare(*(model.percept(image) for image in images)).jod

    light = noisy(scene)
    signals = [
        SIGNALS[transfer](image, screen["peak"] - screen["black"]).astype(np.float32)
        for image in light
    ]
    levels = 2 ** BITS[transfer] - 1
    codes = [np.round(signal * levels) / levels for signal in signals]
    shown = quality("relative", light)
    assert shown < 10
    # Light below 0.005 cd/m² is lost in PQ's, as its authors have it
    assert quality(transfer, signals) == pytest.approx(shown, abs=0.03)
    # The steps of 8 bits can be seen where noise is hardly seen
    least = -0.1 if BITS[transfer] == 8 else -0.03
    assert least < quality(transfer, codes) - shown < 0.03
