"""Renders what a folder lacks of its recipe."""

import hashlib
import json
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any, Final

from plateau import scenes
from plateau.errors import CommandFailed, ExitCode, needs
from plateau.farm.bundle import BundleError
from plateau.farm.bundle.hashes import sha256_of
from plateau.farm.model.states import JobState
from plateau.files.packing import files_of as scene_files
from plateau.processes.interrupts import Interrupts
from plateau.rendering.dataset import manifest
from plateau.rendering.dataset.layouts import files_of
from plateau.rendering.dataset.manifest import FAILED, Manifest
from plateau.rendering.dataset.recipe import Recipe
from plateau.rendering.mapped import Mapped, Task
from plateau.rendering.mapping import Place, rendered
from plateau.rendering.result import IMAGE
from plateau.terminal.dataset_progress import Course

#: A parameter where an element may name a file.
_CHOOSES_A_FILE: Final = re.compile(rb"<(?:include|path|spectrum|string)\b[^>]*\$")
_NOT_IN_NAMES: Final = re.compile(r"[^A-Za-z0-9.-]+")
#: Of the header of an image, what its line says too.
_OF_HEADER: Final = ("scene_sha256", "variant", "renderer", "first_seed", "last_seed", "plateau")

Show = Callable[[Course], None]


def fill(
    recipe: Recipe,
    folder: Path,
    place: Place,
    interrupts: Interrupts,
    *,
    show: Show,
    tell: Callable[[str], None],
) -> list[dict[str, Any]]:
    """Render what the folder lacks; returns the lines of its images, the worst first.

    An interrupt ends the run; what is there by then stays.

    Raises
    ------
    CommandFailed
        The folder has other images than the recipe's, or cannot be written.
    """
    spec, tasks = recipe.job_spec, list(recipe.tasks)
    asked = {
        **json.loads(spec.as_request()),
        "independent": recipe.independent,
        "layout": recipe.layout,
    }
    hashes = _Hashes()
    about = {task.index: manifest.identity(task, asked, hashes.of(task)) for task in tasks}
    with manifest.opened(folder) as there:
        _check_same(there, about)
        lacking = [task for task in tasks if not there.has(task.index)]
        course = Course(total=len(tasks), there=len(tasks) - len(lacking))
        if lacking and course.there:
            tell(f"{folder} has {course.there:,} of {len(tasks):,} images: going on with the rest")
        show(course)
        images = rendered(
            lacking,
            spec,
            place,
            independent=recipe.independent,
            interrupts=interrupts,
            tell=tell,
            tick=lambda: show(course),
        )
        for one in images:
            line = {**_line(one), "digest": manifest.digest(about[one.index])}
            line |= {name: about[one.index][name] for name in ("asked", "scene_files")}
            files = {}
            if not one.failure:
                files = files_of(one, recipe.layout, _name(one.task), spec.max_spp)
            else:
                tell(f"image {one.index} failed: {one.failure}")
            there.add(line, files)
            course.states[line["state"]] += 1
            show(course)
        return worst_first(there.lines[task.index] for task in tasks if task.index in there.lines)


def _check_same(there: Manifest, about: Mapping[int, Mapping[str, Any]]) -> None:
    """Refuse a folder whose images are not those of the recipe; more at its end are welcome."""
    for index, line in sorted(there.lines.items()):
        wanted = about.get(index)
        is_same = wanted is not None and manifest.digest(wanted) == line["digest"]
        if is_same or line["state"] == FAILED:  # what failed may be mended
            continue
        what = "the recipe has no such image any more" if wanted is None else _change(line, wanted)
        raise CommandFailed(
            f"{there.folder} was made by another recipe. Image {index}: {what}. Undo the change, "
            "or give another folder with -o"
        )


def _change(line: Mapping[str, Any], wanted: Mapping[str, Any]) -> str:
    """The first thing in which an image that is there differs from the one that is wanted."""
    had, has = {**line, **line["asked"]}, {**wanted, **wanted["asked"]}
    had["scene"] = Path(line["scene"]).name
    for name in ("rule", *line["asked"], *wanted["asked"], "scene", "parameters", "sensor"):
        if had.get(name) != has.get(name):
            was, now = (one.get(name, "the default") for one in (had, has))
            return f"{name} was {was}, and is {now}"
    return "a file of its scene has changed"


class _Hashes:
    """The SHA-256 of scenes' files."""

    def __init__(self) -> None:
        self._of_file, self._chooses = cache(_hash), cache(_chooses_files)  # scenes share meshes
        self._of_scene: dict[str, str] = {}  # where no parameter chooses a file

    def of(self, task: Task) -> str:
        """That of an image's scene; "" if a file cannot be read, which its job will say."""
        if task.scene_name in self._of_scene:
            return self._of_scene[task.scene_name]
        values = {name: str(value) for name, value in task.parameters.items()}
        try:
            found = scene_files(scenes.path_of(Path(task.scene_name)), values)
            of_all = hashlib.sha256("".join(map(self._of_file, found)).encode()).hexdigest()
            if not any(map(self._chooses, found)):
                self._of_scene[task.scene_name] = of_all
        except (BundleError, OSError, ValueError):
            return ""
        return of_all


def _hash(path: Path) -> str:
    with path.open("rb") as file:
        return sha256_of(file)


def _chooses_files(path: Path) -> bool:
    """Whether a file is XML in which parameters may choose files."""
    with path.open("rb") as file:
        return file.read(1) in b"<\xef \t\r\n" and bool(_CHOOSES_A_FILE.search(file.read()))


def _name(task: Task) -> str:
    """What the files of an image are called: ``box-000012``."""
    path = Path(task.scene_name.removeprefix("scenes:"))
    stem = path.parent.name if path.name == "scene.xml" else path.stem
    return f"{_NOT_IN_NAMES.sub('-', stem) or 'scene'}-{task.index:06d}"


def _line(one: Mapped) -> dict[str, Any]:
    """What the manifest says of an image."""
    task = one.task
    found: dict[str, Any] = {
        "index": one.index,
        "name": _name(task),
        "state": FAILED,
        "reason": one.failure,
        "scene": task.scene_name,
        "parameters": dict(task.parameters),
        "sensor": task.sensor,
    }
    if one.result is None:
        return found
    job = one.result.job
    found |= {
        "state": FAILED if one.failure else job.state.value,
        "reason": one.failure or job.reason,
        "spp": job.spp,
        "width": job.width,
        "height": job.height,
        "seed": job.spec.seed,
        "machine_s": job.machine_s,
    }
    if one.failure:
        return found
    errors = {name: said.model_dump(exclude={"stop"}) for name, said in one.errors.items()}
    jod = errors.pop("jod", None)
    with needs("images"):
        from plateau.farm.images.exr import decode_header

    header = decode_header(one.result.files[IMAGE])
    return {
        **found,
        "errors": {name: said for name, said in errors.items() if said["low"] is not None},
        "jod": None if jod is None else jod["value"],
        "non_finite": one.non_finite,
        **{name: header.get(f"plateau:{name}") for name in _OF_HEADER},
    }


def worst_first(lines: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
    """The lines, those first that failed, then those that missed the target, then by error."""

    def badness(line: dict[str, Any]) -> tuple[int, float]:
        kinds = (FAILED, JobState.CANCELLED.value, JobState.EXHAUSTED.value)
        rank = kinds.index(line["state"]) if line["state"] in kinds else len(kinds)
        return rank, -worth(line)

    return sorted(lines, key=badness)


def worth(line: Mapping[str, Any]) -> float:
    """How bad an image is by its first error, or its JOD; 0 where neither is known."""
    for name, said in line.get("errors", {}).items():
        value = float(said["value"])
        return -value if name == "psnr" else value
    return -float(line.get("jod") or 0.0)


def exit_code(lines: Iterable[Mapping[str, Any]]) -> ExitCode:
    """The exit code for the worst of the images."""
    states = {line["state"] for line in lines}
    if FAILED in states:
        return ExitCode.FAILED
    return ExitCode.MISSED if JobState.EXHAUSTED.value in states else ExitCode.OK


def summary(lines: Iterable[Mapping[str, Any]], most: int = 5) -> Iterator[str]:
    """How many images are in each state, and the worst of them."""
    found = list(lines)
    counts = Counter(line["state"] for line in found)
    yield ", ".join(f"{count:,} {state}" for state, count in counts.items()) or "no images"
    for line in found[:most]:
        yield f"  {line['name']}: {line['reason']}"
        if line.get("non_finite"):
            bad = ", ".join(f"{n} in {count:,} pixels" for n, count in line["non_finite"].items())
            yield f"    NaN or infinite: {bad}"
