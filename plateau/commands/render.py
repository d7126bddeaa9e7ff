"""`plateau render`: one scene to its results, with a process tree for it alone."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from plateau.commands.own_farm import checked_settings, render_alone
from plateau.errors import tell
from plateau.exit_codes import EXIT_CODES
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.states import JobState
from plateau.files.out_folder import ready
from plateau.processes.interrupts import Interrupts

if TYPE_CHECKING:
    from plateau.client import Client
    from plateau.farm.wire.views import JobView
    from plateau.terminal.progress import Progress


def render(
    scene: Path,
    out: Path,
    spec: JobSpec,
    *,
    workers: int,
    threads: int | None,
    as_json: bool,
    curve: bool = True,
) -> int:
    """Render the scene until its job has ended, and write its results; returns the exit code."""
    settings = checked_settings(scene, spec)

    def progress(_: "Client") -> "Progress":
        from rich.console import Console

        from plateau.terminal.progress import progress_on

        return progress_on(Console(stderr=True), curve=curve)

    def write(client: "Client", job: "JobView", when_fetched: Callable[[], None]) -> dict[str, Any]:
        from plateau.commands.outputs import write_or_keep

        # The tree stops while the curve is drawn: nothing more is asked of it.
        return write_or_keep(client, job, out, when_fetched=when_fetched)

    with ready(out), Interrupts() as interrupts:
        try:
            job, about = render_alone(
                scene,
                spec,
                settings,
                interrupts,
                workers=workers,
                threads=threads,
                progress=progress,
                fetch=write,
            )
        except KeyboardInterrupt:
            return interrupts.exit_code

    if as_json:
        print(json.dumps(about, indent=2))
    else:
        from plateau.farm.model.job import utc_now
        from plateau.farm.wire import job_text

        print(job_text.summary(job, utc_now()))
        print(job_text.row("files", ", ".join(about["files"])))
    if job.state is JobState.FAILED:
        tell(f"the job failed: {job.reason}")
    if job.state is JobState.CANCELLED and interrupts.asked.is_set():
        return interrupts.exit_code
    return EXIT_CODES[job.state]
