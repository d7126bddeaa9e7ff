"""`plateau judge`: applies rules and a view to images that are already rendered."""

import json
from pathlib import Path

from plateau.errors import CommandFailed
from plateau.farm.model.spec import JobSpec
from plateau.farm.wire import job_text
from plateau.farm.wire.curve_csv import curve_csv
from plateau.farm.wire.curve_svg import curve_svg
from plateau.farm.wire.report import STYLE
from plateau.files.held import held
from plateau.files.image_series import BrokenSeries, CannotJudge, Judged, find_series, judge_series
from plateau.files.job_folder import owner, write_set
from plateau.files.out_folder import make


def judge(folder: Path, spec: JobSpec, *, cumulative: bool, out: Path | None, as_json: bool) -> int:
    """Judge the folder, print the stops and write the curve to `out`; returns the exit code."""
    if out is None:
        return _judge(folder, spec, None, cumulative=cumulative, as_json=as_json)
    make(out)
    with held(out):
        if (job := owner(out)) is not None:
            raise CommandFailed(
                f"{out} has the results and the curve of job {job}: give another folder with -o"
            )
        return _judge(folder, spec, out, cumulative=cumulative, as_json=as_json)


def _judge(
    folder: Path, spec: JobSpec, out: Path | None, *, cumulative: bool, as_json: bool
) -> int:
    image_spp = spec.slice_spp if "slice_spp" in spec.model_fields_set else None
    series = find_series(folder, image_spp=image_spp, cumulative=cumulative)
    try:
        judged = judge_series(series, spec)
    except BrokenSeries as broken:
        if out is None:
            raise CannotJudge(f"{broken}; -o DIR writes non-finite.png there") from None
        write_set(out, {"non-finite.png": broken.picture})
        raise
    if out is not None:
        _write(judged, spec, out)
    if as_json:
        curve = [point.model_dump(mode="json", exclude={"at"}) for point in judged.points]
        print(json.dumps({"stops": judged.stops, "curve": curve}, indent=2))
        return 0
    last = judged.points[-1]
    size = f"{judged.width}×{judged.height}"
    print(f"{len(judged.points)} evaluations of {size} pixels, to {last.spp:,} spp")
    for name, spp in judged.stops.items():
        when = "would not have stopped" if spp is None else f"would have stopped at {spp:,} spp"
        print(job_text.row(name, when))
    return 0


def _write(judged: Judged, spec: JobSpec, out: Path) -> None:
    pixels = judged.width * judged.height
    drawn = curve_svg(spec, pixels, judged.points, style=STYLE)
    files = {"curve.csv": curve_csv(judged.points), "curve.svg": drawn}
    write_set(out, {name: text.encode() for name, text in files.items()})
