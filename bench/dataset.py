"""Many small images, the camera moved in each, by `plateau.map` and by loops: `make bench-dataset`.

One loop keeps the scene and moves its camera, as a good user of Mitsuba writes it; a naive one
loads the scene each time. All three write EXR files, and run in turns on the same cores. Any scene
will do whose first sensor has a transform, and a film of `$width` and `$height`.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Final

import psutil

from bench import ROOT
from bench.support.processes import take_turns, timed
from bench.support.report import OTHERS, machine_table, write_report
from plateau.farm.process.settings import Settings
from plateau.worker.supervisor.child_start import NICE
from plateau.worker.supervisor.variants import choose

BOX: Final = ROOT / "plateau" / "scenes" / "box"
#: Frames, side in pixels and spp.
_CASES: Final = ((200, 128, 64), (100, 256, 256))
WAYS: Final = ("plateau.map", "scene kept", "scene loaded")
#: Images of each before it counts as under way.
_BEFORE: Final = 4


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--case", nargs=3, type=int, action="append", metavar=("N", "SIDE", "SPP"))
    parser.add_argument("--scene", type=Path, default=BOX, help="a folder or a zip; default: BOX")
    parser.add_argument("--way", choices=WAYS, help=argparse.SUPPRESS)
    parser.add_argument("--folder", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    for case in options.case or _CASES:
        if options.way:
            _render(options.way, options.folder, *case)
        else:
            tables = measure(options.scene, *case)
            write_report("dataset", tables, settings={}, document="performance.md")


def measure(given: Path, frames: int, side: int, spp: int) -> dict[str, Any]:
    """Return the table of a case."""
    with ExitStack() as stack:
        took = stack.enter_context(timed())
        scene = moving(given, Path(stack.enter_context(tempfile.TemporaryDirectory())))
        folders = {way: scene / way for way in WAYS}
        case = ("--case", str(frames), str(side), str(spp))
        ran = take_turns({way: start(way, folder, *case) for way, folder in folders.items()})
        under_way = {}
        for way, folder in folders.items():
            ends = sorted(ran[way].own_s(one.stat().st_mtime) for one in folder.glob("*.exr"))
            under_way[way] = (ends[-1] - ends[_BEFORE]) / (frames - 1 - _BEFORE)
    mapped = WAYS[0]
    row = {
        "": f"{given.stem}, {frames} frames of {side}², {spp} spp",
        "s a frame": f"{under_way[mapped]:.3f}",
    }
    row |= {way: f"{under_way[way] / under_way[mapped]:.2f}" for way in WAYS[1:]}
    row["CPU time"] = f"{ran[WAYS[1]].cpu_s / ran[mapped].cpu_s:.2f}"
    row[OTHERS] = f"{took.others:.3f}"
    machine = [one[:-1] for one in machine_table({"workers": len(os.sched_getaffinity(0))}, [0])]
    return {"dataset-machine": machine, "dataset": [list(row), list(row.values())]}


def moving(given: Path, folder: Path) -> Path:
    """Unpack or copy a scene, whose camera `$x` moves then."""
    if given.is_dir():
        shutil.copytree(given, folder, dirs_exist_ok=True)
    else:
        shutil.unpack_archive(given, folder)
    text = (folder / "scene.xml").read_text()
    text = re.sub(r"(<scene\b[^>]*>)", r'\1<default name="x" value="0"/>', text, count=1)
    moved = r'\1<translate x="$x"/></transform>'
    text = re.sub(r"(<sensor\b.*?)</transform>", moved, text, count=1, flags=re.DOTALL)
    (folder / "scene.xml").write_text(text)
    return folder


def start(way: str, folder: Path, *case: str) -> psutil.Popen:
    folder.mkdir()
    command = [sys.executable, "-m", "bench.dataset", "--way", way, "--folder", str(folder), *case]
    return psutil.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL)


def _render(way: str, folder: Path, frames: int, side: int, spp: int) -> None:
    places = [0.4 * frame / frames for frame in range(frames)]
    if way == WAYS[0]:
        import plateau

        values = [{"width": side, "height": side, "x": place} for place in places]
        for one in plateau.map(folder.parent, values, target=f"fixed:spp={spp}"):
            assert one.result is not None
            (folder / f"{one.index}.exr").write_bytes(one.result.files["image.exr"])
        return
    choice = choose(Settings().cache)
    os.environ["DRJIT_LIBLLVM_PATH"] = choice.llvm_library or ""
    os.nice(NICE)  # as a render child
    for frame, image in enumerate(_loop(choice.variant, folder.parent, side, spp, places, way)):
        image.write(str(folder / f"{frame}.exr"))


def _loop(
    variant: str, scene: Path, side: int, spp: int, xs: list[float], way: str
) -> Iterator[Any]:
    import mitsuba as mi

    mi.set_variant(variant)
    given: dict[str, Any] = {"width": str(side), "height": str(side)}
    loaded: Any = None
    for frame, x in enumerate(xs):
        if way == WAYS[2]:
            loaded = mi.load_file(str(scene / "scene.xml"), **given, x=str(x))
        else:
            if loaded is None:
                loaded = mi.load_file(str(scene / "scene.xml"), **given)
                camera = mi.traverse(loaded.sensors()[0])
                place = mi.Transform4f(camera["to_world"])  # which is changed in its place
            camera["to_world"] = mi.Transform4f().translate([x, 0, 0]) @ place
            camera.update()
        yield mi.Bitmap(mi.render(loaded, spp=spp, seed=frame))


if __name__ == "__main__":
    main()
