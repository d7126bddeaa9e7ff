"""Commands that go on with a job that has ended."""

from typing import Any, Final

from plateau.cli import options as o
from plateau.cli.app import app

_JUDGING: Final = (
    *("rule", "watch", "window", "epsilon", "spp", "min_spp", "step"),
    *("exposure", "white_luminance", "field_of_view", "primaries", "batch"),
)


@app.command("continue")
@o.takes_changes("max_spp", "time_limit", "priority", *_JUDGING)
def continue_job(
    job_id: o.JobId,
    changes: dict[str, Any],
    url: o.Url = None,
    as_json: o.Json = False,
) -> None:
    """Go on with an ended job, to a stricter rule or a higher cap; prints the new job's id.

    For example:
      plateau continue 3f9ac2d01b77 --rule visible:target=0.0001
      plateau watch $(plateau continue 3f9ac2d01b77 --max-spp 20000) -o out

    No sample is rendered twice: the new job takes over those of the old one, which stays as it is.
    What is left out is as in the old job. Where that one kept its slices (--keep-slices) its view
    and its step may change too; where it did not, it can be gone on with for some days. On
    scalar_rgb not every cap goes on with the samples: the refusal names those that do.
    """
    from plateau.commands.continuing import continue_job as run

    run(job_id, changes, url=url, as_json=as_json)


@app.command()
@o.takes_changes(*_JUDGING)
def rejudge(
    job_id: o.JobId,
    changes: dict[str, Any],
    url: o.Url = None,
    as_json: o.Json = False,
) -> None:
    """Judge the kept slices of an ended job again, by other rules or under another view.

    For example:
      plateau rejudge 3f9ac2d01b77 --field-of-view 20 --watch reverse

    Prints the id of a new job, which renders nothing: it says where it would have stopped. For
    jobs that were submitted with --keep-slices; `plateau judge` does the same with files.
    """
    from plateau.commands.continuing import rejudge as run

    run(job_id, changes, url=url, as_json=as_json)
