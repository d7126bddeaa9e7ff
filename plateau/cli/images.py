"""Commands for images that are already rendered."""

from pathlib import Path
from typing import Annotated

import typer

from plateau.cli import options as o
from plateau.cli.app import app
from plateau.cli.spec_fields import view_of_place


@app.command()
def diff(
    reference: Annotated[Path, typer.Argument(help="A PNG or EXR file.")],
    test: Annotated[Path, typer.Argument(help="A file of the same format and size.")],
    field_of_view: Annotated[
        float | None,
        typer.Option(help="Angle that the image's width covers, in degrees.", show_default="45"),
    ] = None,
    viewing_distance: Annotated[
        float | None,
        typer.Option(
            help="Distance to the screen in cm; with --pixel-pitch, in place of the angle."
        ),
    ] = None,
    pixel_pitch: Annotated[
        float | None, typer.Option(help="Distance between the screen's pixels in mm.")
    ] = None,
    pixels_per_degree: Annotated[
        float | None,
        typer.Option(
            help="Pixels in a degree at the image's centre, in place of the angle.",
            show_default="none",
        ),
    ] = None,
    seen: o.Seen = None,
    white_luminance: Annotated[
        float | None, typer.Option(help="White of the display in cd/m².", show_default="100")
    ] = None,
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
      plateau diff a.exr b.exr --layer diffuse --viewing-distance 60 --pixel-pitch 0.25
      plateau diff reference.exr test.exr --seen desk --jod --heat heat.png

    Reads PNG of any depth, and EXR with half or float channels. Transparent pixels are composited
    over black. The exit code is 0 whatever the count, and 2 if the images cannot be compared.
    """
    from plateau.commands.diff import diff as run

    view = view_of_place(seen)
    if pixels_per_degree is not None:
        view["pixels_per_degree"] = pixels_per_degree
    if white_luminance is not None:
        view["white_luminance"] = white_luminance
    code = run(
        reference,
        test,
        field_of_view_deg=field_of_view,
        viewing_distance=viewing_distance,
        pixel_pitch=pixel_pitch,
        layer=layer,
        gamma=gamma,
        map_file=map_file,
        jod=jod,
        heat=heat,
        as_json=as_json,
        primaries=primaries,
        exposure_ev=exposure,
        luminance_only=luminance_only,
        **view,
    )
    raise typer.Exit(code)


@app.command()
def denoise(
    images: Annotated[
        list[Path], typer.Argument(help="Two EXR files or more, of as many samples each.")
    ],
    out: Annotated[Path, typer.Option("--out", "-o", metavar="OUT.exr", help="File to write.")],
    field_of_view: Annotated[
        float, typer.Option(help="Angle that the image's width covers, in degrees.")
    ] = 45.0,
    white_luminance: Annotated[float, typer.Option(help="White of the display in cd/m².")] = 100.0,
    exposure: Annotated[float, typer.Option(help="Exposure in EV.")] = 0.0,
    as_json: o.Json = False,
) -> None:
    """Denoise the mean of renders of one scene, where that is nearer to the truth.

    The images are of any renderer, each with samples of its own (other seeds). They say how
    far the denoiser can be trusted at each pixel, and how many pixels of the result still differ
    visibly from the converged image. Where all have the channels albedo.R, .G, .B and N.X, .Y, .Z,
    these guide the denoiser.

    For example:
      plateau denoise seed1.exr seed2.exr -o clean.exr
      plateau denoise a.exr b.exr c.exr d.exr -o clean.exr --exposure 1

    OUT.exr has the blend as R, G and B, and beside it raw.*, denoised.* and denoised.weight, the
    share of the denoised image.
    """
    from plateau.commands.denoise import denoise as run

    run(
        images,
        out,
        field_of_view_deg=field_of_view,
        white_luminance=white_luminance,
        exposure_ev=exposure,
        as_json=as_json,
    )


#: Options that say how to render.
_RENDERING = (
    *("define", "time_limit", "seed", "variant", "sensor", "keep_slices"),
    *("aov", "exr_precision", "exr_compression", "denoise"),
)


@app.command()
@o.takes_spec(but=(*_RENDERING, *o.AMONG_MANY))
def judge(
    folder: Annotated[Path, typer.Argument(help="Kept slices of a job, or EXR images.")],
    spec: o.Spec,
    cumulative: Annotated[
        bool,
        typer.Option("--cumulative", help="Each image contains the samples of the image before."),
    ] = False,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="DIR", help="Folder for the curve.")
    ] = None,
    as_json: o.Json = False,
) -> None:
    """Evaluate rendered images, and print where each rule would have stopped.

    FOLDER holds the kept slices of a job (--keep-slices), or EXR images of any renderer, read in
    the order of their names, each of --slice-spp samples per pixel. An image with more than 0.1 %
    of its pixels NaN or infinite is not judged; non-finite.png in DIR then marks these pixels.

    For example:
      plateau judge out/slices --rule visible --watch reverse --watch myszkowski -o judged
      plateau judge frames --slice-spp 20 --step 40 --white-luminance 300
    """
    from plateau.commands.judge import judge as run

    raise typer.Exit(run(folder, spec, cumulative=cumulative, out=out, as_json=as_json))
