"""Whether the eyes see noise where people saw it: `python -m bench.people ROOMS`.

SIN3D (Buisine et al., Entropy 23(1):75, 2021) asked people from how many samples per pixel on each
of 16 zones of an image looks free of noise. Each eye says the same here, from the noise of a short
recording, scaled. ROOMS is a folder with ``people.csv`` (view, who, and the spp of each zone) and
zips of Benedikt Bitterli's rooms ("Rendering Resources"); a view whose room lacks is left out.
"""

import argparse
import csv
import math
import re
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from bench import ROOT
from bench.support.recordings import record
from bench.support.report import Table, write_report
from plateau.metric import Half, View
from plateau.metric.compiled import CompiledVisibleDifferences
from plateau.metric.cvvdp import ColorVideoVDP
from plateau.metric.display import displayed
from plateau.metric.noise_model import NoiseModel, noise_model
from plateau.metric.quality import BEST_JOD, display_of

Floats = NDArray[np.float64]

#: The room of a view, and its camera if that is not the room's: origin, target and angle.
VIEWS: Final = {
    "contemporary-bathroom-view0": ("bathroom", ("0, 1.25, -0.5", "-10, 0, -9", "65")),
    "staircase-view1": ("staircase", None),
}
DENSITY: Final = 20  #: pixels per degree: a desk monitor, looked at at 200 %
LOOK: Final = View(pixels_per_degree=DENSITY, white_luminance=200, contrast=1000, ambient_lux=250)
#: Nobody knows how bright the images were that people saw.
EXPOSURES: Final = (-2.0, -1.0, 0.0, 1.0)
PIXELS, ACROSS, SLICE_SPP = 800, 4, 16
#: What was rendered for people, who may have needed more.
MOST_SPP: Final = 10_000.0
#: At so many samples it is judged what a zone loses; between them it is interpolated.
SPP: Final = 2.0 ** np.arange(4, 18)
VISIBLE, JOD = "`visible`", "`jod`"
#: Worst places: a percentile of patches of so many degrees.
_WORST: Final = ((95, 1), (99, 1), (100, 1), (95, 2))
PLACES: Final = {f"worst place, {one[0]} % of {one[1]:g}°": one for one in _WORST}
#: What a zone may lose: a share of its pixels, JOD, and JOD in its worst place.
ALLOWED: Final = {VISIBLE: 0.0002, JOD: 0.5, **dict.fromkeys(PLACES, 0.3)}
_ZONE: Final = PIXELS // ACROSS
ZONES: Final = [
    np.s_[y : y + _ZONE, x : x + _ZONE]
    for y in range(0, PIXELS, _ZONE)
    for x in range(0, PIXELS, _ZONE)
]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("rooms", type=Path, nargs="?", help="people.csv, and zips of rooms")
    parser.add_argument("--spp", type=int, default=256, help="of each recording (256)")
    parser.add_argument("--data", type=Path, default=ROOT / "allocation-data")
    asked = parser.parse_args()
    if asked.rooms is None:
        print(f"{__doc__}\nWithout them there is nothing to measure.")
        return
    with (asked.rooms / "people.csv").open() as file:
        rows = {(row.pop("view"), row.pop("who")): row for row in csv.DictReader(file)}
    said = {who: np.array(list(row.values()), np.float64) for who, row in rows.items()}
    for view, (room, camera) in VIEWS.items():
        if not (asked.rooms / f"{room}.zip").exists() or (view, "people") not in said:
            continue
        scene = scene_of(asked.rooms / f"{room}.zip", asked.data / room, camera)
        file, slices = asked.data / f"{view}-{SLICE_SPP}.f32", asked.spp // SLICE_SPP
        record("slices", scene, 1, PIXELS, PIXELS, slices, SLICE_SPP, 1_000_000, file)
        recording = np.memmap(file, np.float32, "r").reshape(-1, PIXELS, PIXELS, 3)[:slices]
        write_report(
            "people",
            tables(view, recording, said[view, "people"], said[view, "svd-entropy"]),
            settings={"spp": asked.spp, "allowed": ALLOWED},
            notes=["20 pixels per degree, 200 cd/m², 250 lux; the recording's noise, scaled."],
            document="people.md",
        )


def scene_of(room: Path, folder: Path, camera: tuple[str, str, str] | None) -> str:
    """Unpack a room; return its scene's file, with this camera."""
    zipfile.ZipFile(room).extractall(folder)
    (scene,) = folder.rglob("scene.xml")
    if camera is not None:
        origin, target, angle = camera
        place = f'<lookat origin="{origin}" target="{target}" up="0, 1, 0" />'
        before, sensor, rest = scene.read_text().partition("<sensor")
        rest = re.sub(r"<matrix [^>]*/>", place, rest, count=1)
        rest = re.sub(r'(<float name="fov" value=")[^"]*', rf"\g<1>{angle}", rest, count=1)
        scene.write_text(before + sensor + rest)
    return str(scene)


def tables(
    view: str, recording: NDArray[np.float32], people: Floats, stopper: Floats
) -> dict[str, Table]:
    """Return the tables of a view."""
    exposed = {
        ev: needed(CompiledVisibleDifferences(replace(LOOK, exposure_ev=ev)), recording)
        for ev in EXPOSURES
    }
    found = exposed[0.0]
    early = needed(CompiledVisibleDifferences(LOOK), recording[: len(recording) // 4])
    rows = [["a constant", "–", "–", f"{misfit(np.ones_like(people), people):.2f}", *"–––"]]
    rows.append(["SIN3D's stopper", *compared(stopper, people, stopper), "–"])
    for name, one in found.items():
        rows.append([name, *compared(one, people, stopper), f"{np.median(early[name] / one):.2f}"])
    head = ["rank", "5 to 95 %", "log sd", "level", "rank beside the stopper's", "a quarter's spp"]
    cells = []
    for name in (VISIBLE, JOD, "worst place, 95 % of 1°"):
        each = (compared(one[name], people, stopper) for one in exposed.values())
        cells.append([name, *(", ".join((one[0], *one[2:4])) for one in each)])
    return {
        "people": [["spp by", *head], *([f"{view}: {row[0]}", *row[1:]] for row in rows)],
        "people-exposure": [
            ["rank, log sd, level", *(f"{ev:+g} EV" for ev in EXPOSURES)],
            *([f"{view}: {row[0]}", *row[1:]] for row in cells),
        ],
    }


def needed(metric: CompiledVisibleDifferences, recording: NDArray[np.float32]) -> dict[str, Floats]:
    """Return at how many spp each zone has lost as little as allowed, by each eye."""
    spp = SLICE_SPP * len(recording)
    image, even, odd = (
        recording[one].mean(axis=0, dtype=np.float64).astype(np.float32)
        for one in (np.s_[:], np.s_[::2], np.s_[1::2])
    )
    model = noise_model(metric, image, (Half(even, spp / 2), Half(odd, spp / 2)))
    by_spp = [lost(metric, model, math.sqrt(spp / one)) for one in SPP]
    return {
        name: crossed(np.array([one[name] for one in by_spp]), allowed)
        for name, allowed in ALLOWED.items()
    }


def lost(metric: CompiledVisibleDifferences, model: NoiseModel, amount: float) -> dict[str, Floats]:
    """Return what each zone loses with so much of the noise, by each eye."""
    view = metric.view
    eye, clean = ColorVideoVDP(display_of(view, PIXELS)), displayed(model.clean, view)
    sums: dict[str, Floats] = {}
    for signed in (amount, -amount):
        image = model.finite_noisy(signed)
        noisy = displayed(image, view)
        seen = metric.compare(metric.percept(model.clean), metric.percept(image)).visible
        heat = eye.compare(eye.percept(clean), eye.percept(noisy), heat=True).heat
        assert heat is not None  # as asked
        for number, zone in enumerate(ZONES):
            ours, theirs = (eye.percept(np.ascontiguousarray(one[zone])) for one in (clean, noisy))
            found = {VISIBLE: seen[zone].mean(), JOD: BEST_JOD - eye.compare(ours, theirs).jod}
            for name, (percentile, patch) in PLACES.items():
                means = patch_means(heat[zone], round(patch * DENSITY))
                found[name] = BEST_JOD * np.percentile(means, percentile)
            for name, value in found.items():
                sums.setdefault(name, np.zeros(len(ZONES)))[number] += value / 2
    return sums


def patch_means(heat: NDArray[np.float32], side: int) -> Floats:
    """Return the mean of each patch: a square of `side` pixels, or fewer."""
    means = np.asarray(heat, np.float64)
    for _ in range(2):  # down, and then across
        least = min(side, len(means))
        sums = np.zeros((len(means) + 1, means.shape[1]))
        np.cumsum(means, axis=0, out=sums[1:])
        means = ((sums[least:] - sums[:-least]) / least).T
    return means


def crossed(values: Floats, allowed: float) -> Floats:
    """Return where the falling values of each zone, (SPP, zones), reach what is allowed."""
    falling = np.minimum.accumulate(np.log(np.maximum(values, 1e-9)), axis=0)
    logs = [np.interp(-np.log(allowed), -zone, np.log(SPP)) for zone in falling.T]
    return np.exp(logs)


def compared(found: Floats, people: Floats, stopper: Floats) -> list[str]:
    """Return rank with an interval, log sd, level, and rank beside the stopper."""
    draws = np.random.default_rng(1).integers(0, len(people), (2000, len(people)))
    low, high = np.percentile([rank(found[one], people[one]) for one in draws], (5, 95))
    return [
        f"{rank(found, people):+.2f}",
        f"{low:+.2f} to {high:+.2f}",
        f"{misfit(found, people):.2f}",
        f"{np.median(found / people):.2f}",
        f"{rank(found, stopper):+.2f}",
    ]


def rank(one: Floats, other: Floats) -> float:
    """Return Spearman's correlation; equal values share their mean rank, and all equal have 0."""
    if np.ptp(one) == 0 or np.ptp(other) == 0:
        return 0.0
    a, b = (np.array([np.flatnonzero(np.sort(x) == v).mean() for v in x]) for x in (one, other))
    return float(np.corrcoef(a, b)[0, 1])


def misfit(found: Floats, people: Floats) -> float:
    """Return the rms of the log ratio, with the factor that makes it least.

    No more was rendered for people than `MOST_SPP`, so more than that is that.
    """
    factors = np.exp(np.linspace(-12, 12, 2401))[:, np.newaxis]
    logs = np.log(np.minimum(found * factors, MOST_SPP) / people)
    return float(np.sqrt(np.square(logs).mean(axis=1).min()))


if __name__ == "__main__":
    main()
