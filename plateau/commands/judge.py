"""`plateau judge`: applies rules and a view to images that are already rendered."""

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from plateau.commands import options as o
from plateau.commands.app import app
from plateau.commands.options.spec_options import AMONG_MANY, Spec, takes_spec
from plateau.commands.printing import print_json
from plateau.errors import CommandFailed

if TYPE_CHECKING:
    from plateau.farm.model.spec import JobSpec
    from plateau.picture.series import Judged

#: Options that say how to render.
_RENDERING = (
    *("define", "time_limit", "seed", "variant", "sensor", "keep_slices", "allocation"),
    *("aov", "exr_precision", "exr_compression", "denoise"),
)


@app.command()
@takes_spec(but=(*_RENDERING, *AMONG_MANY))
def judge(
    folder: Annotated[Path, typer.Argument(help="Kept slices of a job, or EXR images.")],
    spec: Spec,
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
    from plateau.farm.wire.job_text import row
    from plateau.files.job_folder import owner, whole
    from plateau.files.out_folder import make
    from plateau.picture.series import BrokenSeries, CannotJudge, find_series, judge_series

    with ExitStack() as stack:
        if out is not None:
            make(out)
            if (job := owner(out)) is not None:
                raise CommandFailed(
                    f"{out} has the results and the curve of job {job}: give another folder with -o"
                )
            files = [stack.enter_context(whole(out / f"curve.{kind}")) for kind in ("csv", "svg")]
        image_spp = spec.slice_spp if "slice_spp" in spec.model_fields_set else None
        series = find_series(folder, image_spp=image_spp, cumulative=cumulative)
        try:
            judged = judge_series(series, spec)
        except BrokenSeries as broken:
            if out is None:
                raise CannotJudge(f"{broken}; -o DIR writes non-finite.png there") from None
            with whole(out / "non-finite.png") as file:
                file.write_bytes(broken.picture)
            raise
        if out is not None:
            _write(judged, spec, *files)
    if as_json:
        curve = [point.model_dump(mode="json", exclude={"at"}) for point in judged.points]
        print_json({"stops": judged.stops, "curve": curve})
        return
    last = judged.points[-1]
    size = f"{judged.width}×{judged.height}"
    print(f"{len(judged.points)} evaluations of {size} pixels, to {last.spp:,} spp")
    for name, spp in judged.stops.items():
        when = "would not have stopped" if spp is None else f"would have stopped at {spp:,} spp"
        print(row(name, when))


def _write(judged: "Judged", spec: "JobSpec", table: Path, drawing: Path) -> None:
    from plateau.farm.wire.csv_text import curve_csv
    from plateau.farm.wire.curve_svg import STYLE, curve_svg

    table.write_text(curve_csv(judged.points), encoding="utf-8")
    drawn = curve_svg(spec, judged.width * judged.height, judged.points, style=STYLE)
    drawing.write_text(drawn, encoding="utf-8")
