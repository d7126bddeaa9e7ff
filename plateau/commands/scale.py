"""`plateau scale`: workers in a batch system, as many as the queue needs."""

import logging
import os
import sys
import threading
from functools import partial
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
from plateau.scale.slurm import Slurm, check_commands

_LOG = logging.getLogger("plateau")

#: Without a least number of workers, one leaves after this time without work, even if its scaler
#: has ended.
_LEAVE_AFTER_S: Final = 600.0


def slurm(
    limits: Limits,
    *,
    from_priority: int | None,
    name: str,
    options: list[str],
    script: Path | None,
    worker_env: Path | None,
    every_s: float,
    once: bool,
    dry_run: bool,
    cancel_on_exit: bool,
    as_json: bool,
) -> None:
    """Submit and end workers in Slurm until a signal, or once.

    `name` is that of the tasks in Slurm; `options` are those of sbatch; without `script`, Plateau's
    own batch script is used; `worker_env` is a file of variables for the workers.
    """
    check_commands()
    given = {} if worker_env is None else _variables(worker_env)
    script = script or Path(str(files("plateau.scale") / "worker.sbatch"))
    if not script.is_file():
        raise CommandFailed(
            f"there is no batch script {script}; name one as --script, or leave that out"
        )

    def run(settings: Settings, stop: threading.Event) -> None:
        with connect(settings.redis_url or "") as client:
            if once:  # otherwise `when_checked` has done so
                check_schema(client)
                check_pair(client, Blobs(settings.blobs or ""))
            scaler = Scaler(
                jobs=Jobs(client),
                workers=Workers(client),
                slurm=Slurm(
                    name=name,
                    farm=farm_id(client),
                    script=script,
                    options=options,
                    environment={**_environment(limits, settings), **given},
                ),
                policy=Policy(limits),
                pool=settings.pool,
                tags=settings.all_tags,
                from_priority=from_priority,
                dry_run=dry_run,
                tell=partial(_tell, as_json=as_json),
            )
            if once:
                scaler.step()
                return
            scaler.run(every_s, stop)
            if cancel_on_exit and not dry_run:
                scaler.dismiss_all()

    run_until_signal("scaler", run if once else when_checked(run))


def _environment(limits: Limits, settings: Settings) -> dict[str, str]:
    """Variables of the workers besides those of this process."""
    environment = {"PLATEAU_PYTHON": os.environ.get("PLATEAU_PYTHON", sys.executable)}
    if limits.least == 0 and settings.leave_after_s is None:
        environment["PLATEAU_LEAVE_AFTER_S"] = f"{_LEAVE_AFTER_S:g}"
    return environment


def _variables(file: Path) -> dict[str, str]:
    """The variables in a file of NAME=VALUE lines; empty lines and comments (#) are skipped."""
    lines = (line.strip() for line in file.read_text(encoding="utf-8").splitlines())
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


def _tell(report: Report, *, as_json: bool) -> None:
    if as_json:
        print(report.as_json(), flush=True)
    else:
        _LOG.info("%s", report.in_words())
