"""`plateau scale`: workers in a batch system, as many as the queue needs."""

import os
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from plateau.commands import options as o
from plateau.commands.app import group
from plateau.errors import CommandFailed

if TYPE_CHECKING:
    from plateau.farm.process.settings import Settings
    from plateau.farm.process.waits import Stop
    from plateau.scale.policy import Limits
    from plateau.scale.report import Report

#: Without a least number of workers, one leaves after this time without work, even if its scaler
#: has ended.
_LEAVE_AFTER_S: Final = 600.0

scale = group(
    "scale",
    """
    Run as many workers in a batch system as the queue needs.

    Uses PLATEAU_REDIS_URL and PLATEAU_BLOBS, as workers do, and passes its environment to them.
    """,
)


@scale.command()
def slurm(
    most: Annotated[int, typer.Option("--max", help="Most workers to run at once.", min=0)],
    least: Annotated[
        int, typer.Option("--min", help="Fewest workers to run, even without work.", min=0)
    ] = 0,
    worth: Annotated[
        float,
        typer.Option(
            metavar="SECONDS",
            help="Work that justifies another worker; one slice that takes longer is enough.",
            min=0.001,
        ),
    ] = 60.0,
    calm: Annotated[
        float,
        typer.Option(
            metavar="SECONDS",
            help="Workers leave only after fewer have been needed for this long.",
            min=0,
        ),
    ] = 60.0,
    idle: Annotated[
        float,
        typer.Option(
            metavar="SECONDS",
            help="A worker leaves only after it has been idle for this long.",
            min=0,
        ),
    ] = 30.0,
    from_priority: Annotated[
        int | None,
        typer.Option(
            metavar="PRIORITY",
            help="Jobs of lower priority start no workers; running workers still render them.",
        ),
    ] = None,
    partition: Annotated[str | None, typer.Option(help="Slurm partition, or several: a,b.")] = None,
    cpus: Annotated[
        int | None, typer.Option(help="CPUs, and threads, of each worker.", min=1)
    ] = None,
    gpus: Annotated[
        str | None, typer.Option(metavar="N", help="GPUs of each worker, such as 1 or a100:1.")
    ] = None,
    mem: Annotated[str | None, typer.Option(help="Memory of each worker, such as 16G.")] = None,
    time: Annotated[
        str | None,
        typer.Option(
            metavar="LIMIT",
            help="Time limit of each worker, such as 8:00:00; it leaves before that.",
        ),
    ] = None,
    account: Annotated[str | None, typer.Option(help="Slurm account to charge.")] = None,
    qos: Annotated[str | None, typer.Option(help="Slurm quality of service.")] = None,
    sbatch_option: Annotated[
        list[str] | None,
        typer.Option(
            metavar="OPTION",
            help="Another option for sbatch, such as --sbatch-option=--nice=100; may be repeated.",
        ),
    ] = None,
    logs: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Folder for the workers' logs, on a disk that all machines share.",
            show_default="the current folder",
        ),
    ] = None,
    script: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Your own copy of the batch script, deploy/slurm/worker.sbatch.",
            show_default=False,
        ),
    ] = None,
    worker_env: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="File of NAME=VALUE lines for the workers, such as a Redis URL with fewer rights.",
            show_default="the environment of this command",
        ),
    ] = None,
    name: Annotated[
        str, typer.Option(help="Name of the jobs in Slurm; give two scalers two names.")
    ] = "plateau-worker",
    every: Annotated[
        float,
        typer.Option(metavar="SECONDS", help="Time between two checks of the queue.", min=0.1),
    ] = 10.0,
    once: Annotated[bool, typer.Option("--once", help="Check once and exit, for cron.")] = False,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Print what would be done, and do nothing.")
    ] = False,
    cancel_on_exit: Annotated[
        bool,
        typer.Option(
            "--cancel-on-exit", help="On exit, cancel waiting jobs and ask the workers to leave."
        ),
    ] = False,
    as_json: o.Json = False,
) -> None:
    """Submit as many workers to Slurm as the queue needs, and let them leave afterwards.

    For example:
      plateau scale slurm --max 16 --partition cpu --cpus 16 --mem 32G --time 8:00:00
      plateau scale slurm --max 4 --partition gpu --gpus 1 --name plateau-gpu --from-priority 10
      plateau scale slurm --max 16 --once --dry-run

    Runs until Ctrl-C, on a machine that can submit jobs to Slurm. The workers stay after that, and
    leave after ten minutes without work, unless --min asks for some. A restarted scaler finds its
    jobs by their name and comment. Each change is a line on standard error, or with --json an
    object on standard output. See deploy/slurm/README.md.
    """
    if least > most:
        raise typer.BadParameter(
            f"--min {least} is more than --max {most}; lower one or raise the other"
        )
    named = {
        "partition": partition,
        "cpus-per-task": cpus,
        "gpus": gpus,
        "mem": mem,
        "time": time,
        "account": account,
        "qos": qos,
        "output": None if logs is None else logs.absolute() / "plateau-%A_%a.log",
    }
    options = [f"--{option}={value}" for option, value in named.items() if value is not None]
    for option in sbatch_option or ():
        if not option.startswith("-"):
            raise typer.BadParameter(
                f"{option!r} is not an option of sbatch; write it with its dashes, as --nice=100"
            )
        options.append(option)

    from importlib.resources import files

    from plateau.farm.blobs.store import Blobs
    from plateau.farm.ledger.pairing import check_pair, farm_id
    from plateau.farm.ledger.schema import check_schema
    from plateau.farm.ledger.workers import Workers
    from plateau.farm.redis.link import connect
    from plateau.files.out_folder import make
    from plateau.processes.process import run_until_signal, when_checked
    from plateau.scale.policy import Limits, Policy
    from plateau.scale.scaler import Scaler
    from plateau.scale.slurm import Slurm, check_commands

    if logs is not None:
        make(logs, "--logs")
    limits = Limits(least=least, most=most, worth_s=worth, calm_s=calm, idle_s=idle)
    check_commands()
    given = {} if worker_env is None else _variables(worker_env)
    script = script or Path(str(files("plateau.scale") / "worker.sbatch"))
    if not script.is_file():
        raise CommandFailed(
            f"there is no batch script {script}; name one as --script, or leave that out"
        )

    def run(settings: "Settings", stop: "Stop") -> None:
        with connect(settings.redis_url or "") as client:
            if once:  # otherwise `when_checked` has done so
                check_schema(client)
                check_pair(client, Blobs(settings.blobs or ""))
            scaler = Scaler(
                client=client,
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
            scaler.run(every, stop)
            if cancel_on_exit and not dry_run:
                scaler.dismiss_all()

    run_until_signal("scaler", run if once else when_checked(run))


def _environment(limits: "Limits", settings: "Settings") -> dict[str, str]:
    """Variables of the workers beside those of this process."""
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


def _tell(report: "Report", *, as_json: bool) -> None:
    if as_json:
        print(report.as_json(), flush=True)
    else:
        import logging

        logging.getLogger("plateau").info("%s", report.in_words())
