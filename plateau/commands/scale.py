"""`plateau scale`: workers in a batch system, as many as the queue needs."""

import logging
import os
import sys
import threading
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Final

from plateau.errors import CommandFailed
from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.pairing import check_pair, farm_id
from plateau.farm.ledger.schema import check_schema
from plateau.farm.ledger.workers import Workers
from plateau.farm.process.settings import Settings
from plateau.farm.redis.link import connect
from plateau.processes.process import run_until_signal, when_checked
from plateau.scale.policy import Limits, Policy
from plateau.scale.report import Report
from plateau.scale.scaler import Scaler
from plateau.scale.slurm import Request, Slurm, check_commands

_LOG = logging.getLogger("plateau")

#: A worker whose scaler has gone waits no longer for work, where all may leave.
_LEAVE_AFTER_S: Final = 600.0


@dataclass(frozen=True, kw_only=True)
class Scaling:
    """How the workers are to come and go, and as what."""

    limits: Limits
    from_priority: int | None  #: jobs of a lower one bring no workers
    name: str  #: of the tasks in Slurm
    options: tuple[str, ...]  #: of sbatch
    script: Path | None  #: None for Plateau's own
    worker_env: Path | None  #: variables of the workers
    every_s: float
    once: bool
    dry_run: bool
    cancel_on_exit: bool
    as_json: bool


def slurm(scaling: Scaling) -> None:
    """Submit and end workers in Slurm until a signal, or once.

    Raises
    ------
    CommandFailed
        Slurm's commands or the script are not here, or a setting is missing.
    SystemExit
        It could not go on; its log says why.
    """
    check_commands()
    given = {} if scaling.worker_env is None else _variables(scaling.worker_env)
    script = scaling.script or Path(str(files("plateau.scale") / "worker.sbatch"))
    if not script.is_file():
        raise CommandFailed(
            f"there is no batch script {script}; name one as --script, or leave that out"
        )

    def run(settings: Settings, stop: threading.Event) -> None:
        with connect(settings.redis_url or "") as client:
            if scaling.once:  # the others have been waited for
                check_schema(client)
                check_pair(client, Blobs(settings.blobs or ""))
            request = Request(
                script=script,
                options=scaling.options,
                environment={**_environment(scaling, settings), **given},
            )
            scaler = Scaler(
                Jobs(client),
                Workers(client),
                Slurm(scaling.name, farm_id(client), request),
                Policy(scaling.limits),
                pool=settings.pool,
                tags=settings.tags,
                from_priority=scaling.from_priority,
                dry_run=scaling.dry_run,
                tell=_tell_json if scaling.as_json else _tell,
            )
            if scaling.once:
                scaler.step()
                return
            scaler.run(scaling.every_s, stop)
            if scaling.cancel_on_exit and not scaling.dry_run:
                scaler.dismiss_all()

    run_until_signal("scaler", run if scaling.once else when_checked(run))


def _environment(scaling: Scaling, settings: Settings) -> dict[str, str]:
    """What the workers find in their environment beside what is in ours."""
    environment = {"PLATEAU_PYTHON": os.environ.get("PLATEAU_PYTHON", sys.executable)}
    if scaling.limits.least == 0 and settings.leave_after_s is None:
        environment["PLATEAU_LEAVE_AFTER_S"] = f"{_LEAVE_AFTER_S:g}"
    return environment


def _variables(file: Path) -> dict[str, str]:
    """What a file of NAME=VALUE lines says; empty ones and those that begin with # say nothing."""
    lines = (line.strip() for line in file.read_text().splitlines())
    found: dict[str, str] = {}
    for number, line in enumerate(lines, start=1):
        if line and not line.startswith("#"):
            name, equals, value = line.partition("=")
            if not equals or not name.isidentifier():
                raise CommandFailed(
                    f"{file}, line {number}: {line!r} is not of the form NAME=VALUE"
                )
            found[name] = value
    return found


def _tell(report: Report) -> None:
    _LOG.info("%s", report.in_words())


def _tell_json(report: Report) -> None:
    print(report.as_json(), flush=True)
