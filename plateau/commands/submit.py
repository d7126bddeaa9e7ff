"""`plateau submit | again`: new jobs for a running service."""

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer

from plateau.commands import options as o
from plateau.commands.app import app
from plateau.commands.connect import connect
from plateau.commands.options.spec_options import Spec, takes_changes, takes_spec
from plateau.commands.printing import print_one
from plateau.errors import CommandFailed, tell

if TYPE_CHECKING:
    from plateau.farm.model.spec import JobSpec

_SECRET = "PLATEAU_WEBHOOK_SECRET"


@app.command()
@takes_spec()
def submit(
    scene: o.Scene,
    spec: Spec,
    each: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUES",
            help="Submit one job for each value of the scene's parameter $NAME: 0..99 or 0..99:2 "
            "(whole numbers, the last one included), a,b,c, or a list of ranges; repeated, for "
            "each combination.",
        ),
    ] = None,
    same_seeds: Annotated[
        bool,
        typer.Option(
            "--same-seeds",
            help="With --each: draw the same samples in all frames. Their noise "
            "then stands still, and is seen more. By default each has a seed of its own.",
        ),
    ] = False,
    notify: Annotated[
        list[str] | None,
        typer.Option(
            metavar="WHO",
            help="Who is notified when the job ends: a target that the farm's operator has named, "
            "or a URL, which gets a POST signed with PLATEAU_WEBHOOK_SECRET; may be repeated.",
        ),
    ] = None,
    url: o.Url = None,
    as_json: o.Json = False,
) -> None:
    """Submit a scene to a running service, and print the id of the job or the name of the batch.

    For example:
      plateau submit scenes:box --max-spp 2000 --batch tuesday
      plateau watch $(plateau submit scene.zip -D width=512) -o out
      plateau submit '{assets}/shots/walk/scene.xml' --max-spp 4000
      plateau submit walk.zip --each frame=0..99 --batch walk --min-spp 400
      plateau watch --batch walk -o frames
      plateau submit scene.zip --notify ops --notify https://studio.example/hooks/plateau
    """
    if same_seeds and not each:
        raise typer.BadParameter("--same-seeds is of many jobs: give --each")
    spec = _with_notice(spec, notify or ())
    if each:
        from plateau.files.frames import each as combined

        entries = combined(each)
        with connect(url) as client:
            batch = client.submit_batch(scene, entries, spec, same_seeds=same_seeds)
        print_one(batch, batch.name, as_json=as_json)
        return
    with connect(url) as client:
        job = client.submit(scene, spec)
    print_one(job, job.id, as_json=as_json)

    if job.waits_for:
        tell(f"job {job.id} {job.waits_for}")
    elif job.time_left:
        tell(f"job {job.id} has {job.time_left}")


def _with_notice(spec: "JobSpec", told: Sequence[str]) -> "JobSpec":
    """The spec with those who are told of the job's end: names of targets, and a URL."""
    from pydantic import ValidationError

    from plateau.farm.model import input_errors
    from plateau.farm.model.spec.notice import NoticeSpec

    if not told:
        return spec
    urls = [one for one in told if "/" in one]
    if len(urls) > 1:
        raise CommandFailed("--notify: a job has one URL")
    asked: dict[str, object] = {"targets": tuple(one for one in told if one not in urls)}
    if urls:
        asked |= {"url": urls[0], "secret": os.environ.get(_SECRET) or None}
    try:
        notice = NoticeSpec.model_validate(asked)
    except ValidationError as error:
        found = error.errors()[0]
        name = _SECRET if found["loc"][0] == "secret" else "--notify"
        raise CommandFailed(f"{name}: {input_errors.message(found)}") from None
    if notice.url is not None and notice.secret is None:
        raise CommandFailed(
            f"what is sent to {notice.url} has to be signed: export {_SECRET}=whsec_$(openssl rand "
            "-base64 32)"
        )
    return spec.model_copy(update={"notice": notice})


@app.command()
@takes_changes(but={"shot"})
def again(
    job_id: o.JobId, changes: dict[str, Any], url: o.Url = None, as_json: o.Json = False
) -> None:
    """Render an ended job again, with the samples that it has, and print the new job's id.

    For example:
      plateau again 3f9ac2d01b77 --rule visible:target=0.0001
      plateau again 3f9ac2d01b77 --seed 1
      plateau watch $(plateau again 3f9ac2d01b77 --max-spp 20000) -o out

    Options that are not given are as in the old job, which stays as it is. The new job keeps the
    old one's samples if they are left and the changes allow it; standard error says how many, or
    why none. A stricter rule and a higher cap allow it, but on scalar_rgb not every cap does. If
    the old job kept its slices (--keep-slices), the view and the step may change too, and with a
    --max-spp that is not beyond them nothing is rendered. Another --seed draws other samples.
    """
    from plateau.farm.wire import job_text

    with connect(url) as client:
        job = client.again(client.whole_id(job_id), **changes)
    print_one(job, job.id, as_json=as_json)
    tell(f"job {job.id} {job_text.again(job)}")
    if job.waits_for:
        tell(f"job {job.id} {job.waits_for}")
