"""Commands that run workers in a batch system, as many as the queue needs."""

from pathlib import Path
from typing import Annotated

import typer

from plateau.cli import options as o
from plateau.cli.app import group

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
    from plateau.commands.scale import slurm as run
    from plateau.scale.policy import Limits

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
    if logs is not None:
        from plateau.files.out_folder import make

        make(logs, "--logs")
    run(
        Limits(least=least, most=most, worth_s=worth, calm_s=calm, idle_s=idle),
        from_priority=from_priority,
        name=name,
        options=options,
        script=script,
        worker_env=worker_env,
        every_s=every,
        once=once,
        dry_run=dry_run,
        cancel_on_exit=cancel_on_exit,
        as_json=as_json,
    )
