"""`plateau diff`: the visible differences between two images."""

import json
import re
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from plateau.exit_codes import ExitCode
from plateau.files.image_diff import CannotCompare, compare_files
from plateau.files.job_folder import whole
from plateau.metric import View
from plateau.metric.display import SeenFrom


def diff(
    reference: Path,
    test: Path,
    *,
    gamma: float | None,
    layer: str | None,
    viewing_distance: float | None,
    pixel_pitch: float | None,
    field_of_view_deg: float | None,
    map_file: Path | None,
    jod: bool,
    heat: Path | None,
    as_json: bool,
    **view: Any,
) -> int:
    """Compare, write the map, print; returns the exit code, which is 0 whatever the count.

    What is in `view` goes to `metric.View`.
    """
    try:
        if field_of_view_deg is not None:
            view["field_of_view_deg"] = field_of_view_deg
        shown = _view(gamma, view)
        if view.get("pixels_per_degree") and (field_of_view_deg or viewing_distance):
            raise CannotCompare(
                "give --seen or --pixels-per-degree, or how large the image is: both say at which "
                "angle a pixel is seen"
            )
        seen_from = _seen_from(viewing_distance, pixel_pitch, field_of_view_deg)
        for option, file in (("--map", map_file), ("--heat", heat)):
            if file is not None and file.resolve() in {reference.resolve(), test.resolve()}:
                raise CannotCompare(f"{option} {file} would overwrite an image that is compared")
        with ExitStack() as stack:
            files = [file and stack.enter_context(whole(file)) for file in (map_file, heat)]
            comparison = compare_files(
                reference,
                test,
                shown,
                gamma=gamma,
                layer=layer,
                seen_from=seen_from,
                jod=jod or heat is not None,
            )
            if files[0] is not None:
                comparison.write_map(files[0])
            if files[1] is not None:
                comparison.write_heat(files[1])
    except CannotCompare as error:
        print(f"plateau: {error}", file=sys.stderr)
        return ExitCode.USAGE
    print(json.dumps(comparison.as_json()) if as_json else comparison.in_words())
    return ExitCode.OK


def _seen_from(
    viewing_distance: float | None, pixel_pitch: float | None, field_of_view_deg: float | None
) -> SeenFrom | None:
    if viewing_distance is None and pixel_pitch is None:
        return None
    if viewing_distance is None or pixel_pitch is None:
        raise CannotCompare("give --viewing-distance and --pixel-pitch together")
    if field_of_view_deg is not None:
        raise CannotCompare(
            "give --field-of-view, or --viewing-distance and --pixel-pitch: both "
            "say how large the image is"
        )
    try:
        return SeenFrom(viewing_distance_cm=viewing_distance, pixel_pitch_mm=pixel_pitch)
    except ValueError as error:
        raise _by_option(error) from error


def _view(gamma: float | None, given: dict[str, Any]) -> View:
    try:
        return View(**given, gamma=1.0 if gamma is None else gamma)
    except ValueError as error:
        raise _by_option(error) from error


def _by_option(error: ValueError) -> CannotCompare:
    """Return the error in the words of the command line: fields have units in their names."""
    field, _, rule = str(error).partition(" ")
    option = re.sub(r"_(ev|deg|cm|mm)$", "", field).replace("_", "-")
    return CannotCompare(f"--{option} {rule}")
