"""`plateau diff`: the visible differences between two images."""

import json
import sys
from pathlib import Path
from typing import Any

from metric import View
from plateau.diff import CannotCompare, compare_files
from plateau.exits import ExitCode


def diff(
    reference: Path,
    test: Path,
    *,
    gamma: float | None,
    map_file: Path | None,
    as_json: bool,
    **view: Any,
) -> int:
    """Compare, write the map, print; returns the exit code, which is 0 whatever the count.

    What is in `view` goes to `metric.View`.
    """
    try:
        shown = _view(gamma, view)
        if map_file is not None and map_file.resolve() in {reference.resolve(), test.resolve()}:
            raise CannotCompare(f"--map {map_file} would overwrite an image that is compared")
        comparison = compare_files(reference, test, shown, gamma=gamma)
    except CannotCompare as error:
        print(f"plateau: {error}", file=sys.stderr)
        return ExitCode.USAGE
    if map_file is not None:
        comparison.write_map(map_file)
    print(json.dumps(comparison.as_json()) if as_json else comparison.in_words())
    return ExitCode.OK


def _view(gamma: float | None, given: dict[str, Any]) -> View:
    try:
        return View(**given, gamma=1.0 if gamma is None else gamma)
    except ValueError as error:
        field, _, rule = str(error).partition(" ")
        option = field.removesuffix("_ev").removesuffix("_deg").replace("_", "-")
        raise CannotCompare(f"--{option} {rule}") from error
