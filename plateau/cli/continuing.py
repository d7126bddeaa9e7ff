"""Commands that continue an ended job, try it again, or submit its scene again."""

from inspect import signature
from typing import Any, Final

from plateau.cli import options as o
from plateau.cli.app import app
from plateau.cli.spec_fields import refusing

_JUDGING: Final = (
    *("rule", "watch", "min_spp", "step", "denoise"),
    *("exposure", "white_luminance", "contrast", "ambient_lux", "field_of_view"),
    *("pixels_per_degree", "seen"),
    *("primaries", "background", "focus", "batch"),
)
#: A single job is no shot.
_ALL: Final = tuple(name for name in signature(o.spec_from_options).parameters if name != "shot")


@app.command("continue")
@o.takes_changes("max_spp", "time_limit", "priority", *_JUDGING)
def continue_job(
    job_id: o.JobId, changes: dict[str, Any], url: o.Url = None, as_json: o.Json = False
) -> None:
    """Continue an ended job with a stricter rule or a higher cap, and print the new job's id.

    For example:
      plateau continue 3f9ac2d01b77 --rule visible:target=0.0001
      plateau watch $(plateau continue 3f9ac2d01b77 --max-spp 20000) -o out

    The new job takes over the samples of the old job, which stays as it is; no sample is rendered
    twice. Options that are not given are as in the old job. If the old job kept its slices
    (--keep-slices), the view and the step may change too. Otherwise it can be continued for a few
    days only. On scalar_rgb some caps do not fit the samples; the error message lists those that
    do.
    """
    from plateau.commands.jobs import continue_job as run

    run(job_id, changes, url=url, as_json=as_json)


@app.command()
@o.takes_changes(*_JUDGING)
def rejudge(
    job_id: o.JobId, changes: dict[str, Any], url: o.Url = None, as_json: o.Json = False
) -> None:
    """Judge the kept slices of an ended job again, with other rules or another view.

    For example:
      plateau rejudge 3f9ac2d01b77 --field-of-view 20 --watch reverse

    Prints the id of a new job, which renders nothing and shows where it would have stopped. Works
    for jobs submitted with --keep-slices; `plateau judge` does the same with files.
    """
    from plateau.commands.jobs import rejudge as run

    run(job_id, changes, url=url, as_json=as_json)


@app.command()
@o.takes_changes(*_ALL)
def resubmit(
    job_id: o.JobId, changes: dict[str, Any], url: o.Url = None, as_json: o.Json = False
) -> None:
    """Submit the scene of a job again, and print the new job's id.

    For example:
      plateau resubmit 3f9ac2d01b77 --max-spp 20000 -D width=1920 -D height=1080
      plateau watch $(plateau resubmit 3f9ac2d01b77 --rule jod) -o out

    The new job begins with no sample. Options that are not given are as in the old job, but for the
    webhook and the jobs that it waited for. `plateau continue` keeps the samples.
    """
    from plateau.commands.jobs import resubmit as run

    with refusing():
        run(job_id, changes, url=url, as_json=as_json)
