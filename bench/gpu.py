"""A GPU's samples a second, by Mitsuba alone and by the farm's kernel: `make bench-gpu`.

Mitsuba's own `render` gets the samples per pass that are fastest for it, the farm's pass kernel
likewise; they alternate in one process, on one scene that is prepared once. Then `plateau render`
renders the same scenes to 9.5 JOD, by zones and by frames: what a user waits for. ``--renders``
leaves out the first. With ``--rooms`` the zips of a folder are rendered too, such as Benedikt
Bitterli's rooms ("Rendering Resources").

It runs with any variant (``--variant llvm_ad_rgb``), and says which card it had. The report is
written after each case, so that a run that is cut off leaves what it has measured.
"""

import argparse
import hashlib
import json
import os
import shutil
import tempfile
import time
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from bench import ROOT
from bench.support import processes
from bench.support.report import Table, write_report
from plateau.worker.renderers.contract import Load
from plateau.worker.supervisor import gpus

SCENES: Final = ("box", "oculist")
#: The name of a figure with its unit, and its values.
_Found = tuple[str, list[float]]


@dataclass(frozen=True, kw_only=True)
class Plan:
    """What is rendered, and how often."""

    variant: str = "cuda_ad_rgb"
    sizes: tuple[tuple[int, int], ...] = ((512, 512), (1920, 1080))
    spp: tuple[int, ...] = (4, 16, 64, 256)  #: of a pass, to choose the fastest from
    pairs: int = 5
    rooms: Path | None = None
    rates: bool = True  #: whether to measure samples per second
    jod: float = 9.5
    limit_s: int = 60  #: of a whole render: a room's target may be hours away
    out: str = "gpu"  #: the report's name


ALLOCATIONS: Final = ("zones", "frame")
SMALL: Final = Plan(sizes=((32, 32),), spp=(4, 8), pairs=2, jod=5.0, out="gpu-small")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--variant", default=Plan.variant)
    parser.add_argument("--rooms", type=Path, help="a folder with zips of more scenes")
    parser.add_argument("--limit", type=int, default=Plan.limit_s, help="of a whole render, in s")
    parser.add_argument("--pairs", type=int, default=Plan.pairs)
    parser.add_argument("--renders", action="store_true", help="whole renders alone")
    parser.add_argument("--small", action="store_true", help="a dry run, of tiny images")
    asked = parser.parse_args()
    plan = replace(
        SMALL if asked.small else Plan(pairs=asked.pairs, limit_s=asked.limit),
        variant=asked.variant,
        rooms=asked.rooms,
        rates=not asked.renders,
    )
    if asked.renders:
        plan = replace(plan, out=f"{plan.out}-renders")
    measure(plan, SCENES[:1] if asked.small else SCENES)


def measure(plan: Plan, scenes: tuple[str, ...] = SCENES) -> None:
    """Measure all cases of a plan, and report each.

    Raises
    ------
    ImportError
        This machine has no such variant; the message is Mitsuba's.
    """
    import drjit as dr
    import mitsuba as mi

    mi.set_variant(plan.variant)
    mi.set_log_level(mi.LogLevel.Error)
    dr.set_log_level(dr.LogLevel.Error)
    notes = [
        f"Each of {plan.pairs} runs of a case renders as many samples by both.",
        "A whole render is `plateau render`, from the command to its results on the disk.",
    ]
    with tempfile.TemporaryDirectory() as folder:
        for name, scene, entry in _scenes(plan, scenes, Path(folder)):
            for width, height in plan.sizes:
                case = f"{name}, {width}×{height}"
                parameters = {"width": str(width), "height": str(height)}
                load = Load(folder=str(scene), entry=entry, parameters=parameters)
                table: Table = [["case", "what", "value"]]
                try:
                    for what, values in _rates(plan, load) if plan.rates else ():
                        table.append([case, what, _in_words(values)])
                    for allocation in ALLOCATIONS:
                        way = f"{case}, by {allocation}"
                        options = parameters, {"--allocation": allocation}
                        for what, values in _whole(plan, scene, *options, Path(folder) / "results"):
                            table.append([way, what, _in_words(values)])
                except Exception as error:  # noqa: BLE001 - the others are measured nevertheless
                    notes.append(f"{case}: {type(error).__name__}: {error}")
                write_report(plan.out, {"gpu": table}, settings=_settings(plan), notes=notes)


def _in_words(values: list[float]) -> str:
    """Return the median, and with several values the lowest and the highest."""
    extent = f" ({min(values):.4g} to {max(values):.4g})" if len(values) > 1 else ""
    return f"{median(values):.4g}{extent}"


def _scenes(plan: Plan, scenes: tuple[str, ...], folder: Path) -> Iterator[tuple[str, Path, str]]:
    """Yield each scene's name, its folder and its main file."""
    for name in scenes:
        yield name.upper(), ROOT / "scenes" / name, "scene.xml"
    for room in sorted(plan.rooms.glob("*.zip")) if plan.rooms else ():
        zipfile.ZipFile(room).extractall(folder / room.stem)
        (entry,) = (folder / room.stem).rglob("scene.xml")
        yield room.stem, entry.parent, entry.name


def _rates(plan: Plan, load: Load) -> Iterator[_Found]:
    """Yield the samples per second of both, and whether bits stay as they are."""
    import drjit as dr

    from plateau.worker.renderers.mitsuba.kernel import Kernel
    from plateau.worker.renderers.mitsuba.scene_prep import prepare

    one = prepare(plan.variant, load)
    kernel = Kernel(one)

    def alone(spp: int, seed: int) -> None:
        one.integrator.render(
            one.scene, one.sensor, seed=seed, spp=spp, develop=False, evaluate=True
        )
        dr.sync_thread()

    def ours(spp: int, seed: int) -> NDArray[np.float32]:
        (film,) = kernel.films([(spp, seed)], (), lambda: False)
        return film

    pixels = one.width * one.height
    best = [min(plan.spp, key=lambda spp: _per_sample(way, spp)) for way in (alone, ours)]
    # As many samples of each. After the other's pass Dr.Jit records anew, so one is not counted.
    most = max(best)
    rates: tuple[list[float], list[float]] = ([], [])
    for pair in range(plan.pairs):
        for way, spp, found in zip((alone, ours), best, rates, strict=True):
            way(spp, 999)
            began = time.monotonic()
            for number in range(most // spp):
                way(spp, 1000 * pair + number)
            found.append(most * pixels / (time.monotonic() - began) / 1e6)
    names = ("Mitsuba alone", "the farm's kernel")
    for name, spp, found in zip(names, best, rates, strict=True):
        yield f"{name}, passes of {spp} spp, million samples/s", found
    ratios = [mine / bare for bare, mine in zip(*rates, strict=True)]
    yield "kernel, ratio", ratios
    yield "equal bits, of 1", [float(_has_equal_bits(kernel, ours, best[1]))]
    memory_mib = _nvidia_smi("memory.used")
    if memory_mib is not None:
        yield "memory of the card in use, MiB", [float(memory_mib)]


def _seconds(way: Callable[[int, int], object], spp: int, seed: int) -> float:
    began = time.monotonic()
    way(spp, seed)
    return time.monotonic() - began


def _per_sample(way: Callable[[int, int], object], spp: int) -> float:
    """Return the seconds of a sample in every pixel, once kernels and chunks have settled."""
    for seed in range(2):
        way(spp, seed)
    return min(_seconds(way, spp, seed) for seed in range(2, 5)) / spp


def _has_equal_bits(kernel: Any, ours: Callable[[int, int], NDArray[np.float32]], spp: int) -> bool:
    """Render a pass twice, and in other chunks; return whether its bits stay as they are."""
    films = [ours(spp, 7), ours(spp, 7)]
    kernel._samples = 2**17
    films.append(ours(spp, 7))
    return len({hashlib.sha256(film.tobytes()).digest() for film in films}) == 1


def _whole(
    plan: Plan, scene: Path, parameters: dict[str, str], options: dict[str, Any], out: Path
) -> Iterator[_Found]:
    """Yield what `plateau render` takes to the target, and what its machine does meanwhile."""
    shutil.rmtree(out, ignore_errors=True)
    options |= {
        "--variant": plan.variant,
        "--rule": f"jod:target={plan.jod}",
        "--time-limit": plan.limit_s,
    }
    began = time.monotonic()
    processes.render(scene, out, parameters=parameters, options=options)
    seconds = time.monotonic() - began
    job = json.loads((out / "summary.json").read_text())
    until = f"{plan.jod} JOD" if job["state"] == "converged" else f"its limit of {plan.limit_s} s"
    yield f"whole render to {until}, s", [seconds]
    yield "of it rendering, s", [job["machine_s"]]
    yield "samples of the whole render, spp", [job["spp"]]
    idle = max(0.0, 1 - job["machine_s"] / job["wall_s"])
    yield "share of the job in which no slice rendered, of its time", [idle]


def _settings(plan: Plan) -> dict[str, Any]:
    return {
        "variant": plan.variant,
        "card": _nvidia_smi("name"),
        "driver": _nvidia_smi("driver_version"),
        "pairs": plan.pairs,
        "spp_of_a_pass": list(plan.spp),
        "threads": len(os.sched_getaffinity(0)),
        "target_jod": plan.jod,
        "limit_s": plan.limit_s,
    }


def _nvidia_smi(what: str) -> str | None:
    """Return what the driver says of this machine's first NVIDIA card; None without one."""
    return next((found for [found] in gpus.cards(what)), None)


if __name__ == "__main__":
    main()
