"""`plateau diff`: the visible differences between two images."""

import re
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer

from plateau.commands import options as o
from plateau.commands.app import app
from plateau.commands.options.spec_fields import view_of_place
from plateau.commands.printing import print_json
from plateau.errors import ExitCode, tell

_Made = TypeVar("_Made")


@app.command()
def diff(
    reference: Annotated[Path, typer.Argument(help="A PNG or EXR file.")],
    test: Annotated[Path, typer.Argument(help="A file of the same format and size.")],
    field_of_view: o.FieldOfView = None,
    pixels_per_degree: o.PixelsPerDegree = None,
    seen: o.Seen = None,
    white_luminance: o.WhiteLuminance = None,
    gamma: Annotated[
        float | None,
        typer.Option(
            help="Exponent from the files' values to linear light.",
            show_default="2.2 for PNG, 1 for EXR",
        ),
    ] = None,
    primaries: Annotated[
        str, typer.Option(help="Primaries of the display: rec709 or adobe1998.")
    ] = "rec709",
    exposure: Annotated[float, typer.Option(help="Exposure in EV.")] = 0.0,
    luminance_only: Annotated[
        bool, typer.Option("--luminance-only", help="Ignore differences in colour.")
    ] = False,
    layer: Annotated[
        str | None,
        typer.Option(help="Layer of EXR files.", show_default="the plain R, G, B"),
    ] = None,
    map_file: Annotated[
        Path | None,
        typer.Option(
            "--map",
            metavar="OUT.png",
            help="File for a copy of TEST with visible differences marked.",
        ),
    ] = None,
    jod: Annotated[
        bool,
        typer.Option(
            "--jod",
            help="Also print the quality of TEST by ColorVideoVDP: 10 JOD is no difference, 9 one "
            "by which three of four people prefer REFERENCE.",
        ),
    ] = False,
    heat: Annotated[
        Path | None,
        typer.Option(
            metavar="OUT.png",
            help="File for a map of where ColorVideoVDP sees differences: from dark blue, none, to "
            "yellow, 3 JOD and more; with --jod.",
        ),
    ] = None,
    as_json: o.Json = False,
) -> None:
    """Count the pixels that differ visibly between two images.

    For example:
      plateau diff before.png after.png --map difference.png
      plateau diff reference.exr test.exr --exposure 1 --json
      plateau diff a.exr b.exr --layer diffuse --pixels-per-degree 42
      plateau diff reference.exr test.exr --seen desk --jod --heat heat.png

    Reads PNG of any depth, and EXR with half or float channels. Transparent pixels are composited
    over black. The exit code is 0 whatever the count, and 2 if the images cannot be compared.
    """
    from plateau.files.job_folder import whole
    from plateau.metric import View
    from plateau.picture.diff import CannotCompare, compare_files

    view = view_of_place(seen) | {
        "exposure_ev": exposure,
        "primaries": primaries,
        "luminance_only": luminance_only,
        "gamma": 1.0 if gamma is None else gamma,
    }
    given = {
        "field_of_view_deg": field_of_view,
        "pixels_per_degree": pixels_per_degree,
        "white_luminance": white_luminance,
    }
    view |= {name: value for name, value in given.items() if value is not None}
    if pixels_per_degree is not None:
        view["field_of_view_deg"] = None  # of the place
    try:
        shown = _made(View, view)
        if field_of_view and (seen or pixels_per_degree):
            raise CannotCompare(
                "give --seen or --pixels-per-degree, or --field-of-view: both say at which angle a "
                "pixel is seen"
            )
        for option, file in (("--map", map_file), ("--heat", heat)):
            if file is not None and file.resolve() in {reference.resolve(), test.resolve()}:
                raise CannotCompare(f"{option} {file} would overwrite an image that is compared")
        with ExitStack() as stack:
            made = [file and stack.enter_context(whole(file)) for file in (map_file, heat)]
            comparison = compare_files(
                reference,
                test,
                shown,
                gamma=gamma,
                layer=layer,
                jod=jod or heat is not None,
            )
            for file, write in zip(
                made, (comparison.write_map, comparison.write_heat), strict=True
            ):
                if file is not None:
                    write(file)
    except CannotCompare as error:
        tell(str(error))
        raise typer.Exit(ExitCode.USAGE) from None
    if as_json:
        print_json(comparison.as_json())
    else:
        print(comparison.in_words())


def _made(kind: Callable[..., _Made], fields: dict[str, Any]) -> _Made:
    """Return what these fields make; an error names the option of a wrong one."""
    try:
        return kind(**fields)
    except ValueError as error:
        from plateau.picture.diff import CannotCompare

        field, _, rule = str(error).partition(" ")
        option = re.sub(r"_(ev|deg)$", "", field).replace("_", "-")
        raise CannotCompare(f"--{option} {rule}") from error
