"""Pairs of images made by code, and what the authors' ColorVideoVDP says of them.

`python -m tests.support.images.quality_goldens` records `tests/reference/quality/stills.json` anew,
where `cvvdp` 0.5.7 is installed; it takes a minute. Images are multiples of 1/255, so that every
machine has the same, and the renders are those of `tests/reference/goldens`.
"""

import json
from pathlib import Path

import numpy as np
from PIL import Image

REFERENCE = Path(__file__).parents[2] / "reference"
STILLS = REFERENCE / "quality" / "stills.json"

#: Arguments of `plateau.metric.cvvdp.Display`.
DISPLAYS = {
    "desk": {"pixels_per_degree": 75.4},
    "near desk": {"pixels_per_degree": 37.8, "peak": 100, "black": 0.1},
    "wall": {"pixels_per_degree": 5.7, "peak": 100, "black": 0.1, "ambient_lux": 0},
    "cinema": {"pixels_per_degree": 40, "peak": 48, "black": 0.024, "ambient_lux": 0},
    "phone": {"pixels_per_degree": 61, "peak": 500, "black": 0.05},
    "dim": {"pixels_per_degree": 20, "exposure": 0.4},
    "overexposed": {"pixels_per_degree": 20, "exposure": 2.5, "primaries": "rec2020"},
}
SCENES = ["ramp", "checks", "disks", "texture", "dark", "bars"]
CHANGES = ["noise", "blur", "offset", "tint", "steps", "shift", "fireflies", "blocks"]


def pair(name):
    """Return the reference and the test image of this name, (H, W, 3) float32 in [0, 1]."""
    if " " not in name:  # a render
        return tuple(_read(REFERENCE / "goldens" / f"{name}.{side}.png") for side in "ba")
    scene, change, size = name.split()
    height, width = (int(number) for number in size.split("x"))
    rng = np.random.default_rng([SCENES.index(scene), CHANGES.index(change), height, width])
    reference = made(scene, height, width, rng)
    return rounded(reference), rounded(_changed(rounded(reference), change, rng))


def _read(file):
    with Image.open(file) as picture:
        return np.asarray(picture.convert("RGB"), np.float32) / np.float32(255)


def rounded(image):
    """Return the image in multiples of 1/255, in [0, 1]."""
    codes = np.round(np.clip(image, 0, 1) * 255).astype(np.float32)
    return codes / np.float32(255)


def made(scene, height, width, rng):
    """Return one of the `SCENES`, (H, W, 3)."""
    y, x = np.mgrid[0:height, 0:width] / max(height, width)
    if scene == "ramp":
        return np.stack([x, y, 1 - x], axis=-1)
    if scene == "checks":
        odd = (np.floor(9 * x) + np.floor(6 * y)) % 2 == 0
        return np.where(odd, 0.8, 0.25)[..., None] * np.stack([x, 1 - y, 0.5 + 0 * x], axis=-1)
    if scene == "disks":
        image = np.full((height, width, 3), 0.35)
        for _ in range(12):
            centre_y, centre_x, radius = rng.random(3) * (1, 1, 0.2)
            image[(x - centre_x) ** 2 + (y - centre_y) ** 2 < radius**2] = rng.random(3)
        return image
    if scene == "texture":
        return 0.3 + 0.5 * rng.random((height, width, 1)) * np.array([1, 0.8, 0.6])
    if scene == "dark":
        return 0.08 * np.stack([x, x * y, y], axis=-1) + 0.01
    return np.repeat(((np.floor(width * x / 3) % 4) < 2) * 0.7 + 0.1, 3).reshape(height, width, 3)


def _changed(image, change, rng):
    if change == "noise":
        return image + 0.1 * (rng.random(image.shape) - 0.5)
    if change == "blur":
        for axis in (0, 1):
            image = (np.roll(image, 1, axis) + image + np.roll(image, -1, axis)) / 3
        return image
    if change == "offset":
        return image * 0.9 + 0.02
    if change == "tint":
        return image * np.array([1.06, 0.98, 0.9])
    if change == "steps":
        return np.round(image * 20) / 20
    if change == "shift":
        return np.roll(image, 1, axis=1)
    if change == "fireflies":
        return np.where(rng.random((*image.shape[:2], 1)) < 0.003, 1, image)
    corner = image.copy()
    corner[: image.shape[0] // 2, : image.shape[1] // 2] *= 0.8
    return corner


def authors_model(display):
    """Return the authors' model on the display of this name."""
    import pycvvdp
    import torch
    from pycvvdp.display_model import vvdp_display_geometry, vvdp_display_photo_eotf

    about = {
        "peak": 200, "black": 0.2, "ambient_lux": 250, "exposure": 1,
        "pixels_per_degree": 75.4, "primaries": "rec709", **DISPLAYS[display],
    }  # fmt: skip
    photometry = vvdp_display_photo_eotf(
        about["peak"],
        contrast=about["peak"] / about["black"] if about["black"] else float("inf"),
        source_colorspace="sRGB",
        E_ambient=about["ambient_lux"],
        exposure=about["exposure"],
    )
    if about["primaries"] == "rec2020":
        wide = vvdp_display_photo_eotf(1, source_colorspace="BT.2020-linear")
        photometry.rgb2xyz_list = wide.rgb2xyz_list
    return pycvvdp.cvvdp(
        display_photometry=photometry,
        display_geometry=vvdp_display_geometry((1, 1), ppd=about["pixels_per_degree"]),
        heatmap="raw",
        device=torch.device("cpu"),
        quiet=True,
    )


def write_rows(rows, file):
    """Write one golden a line."""
    file.parent.mkdir(exist_ok=True)
    lines = ",\n".join(json.dumps(row) for row in rows)
    file.write_text(f"[\n{lines}\n]\n")


def _record():
    rows = json.loads(STILLS.read_text())
    for row in rows:
        reference, test = pair(row["pair"])
        jod, about_it = authors_model(row["display"]).predict(test, reference, dim_order="HWC")
        row["jod"], row["mean_heat"] = float(jod), about_it["heatmap"].float().mean().item()
    write_rows(rows, STILLS)


if __name__ == "__main__":
    _record()
