"""Commands that have a batch system run workers, as many as the queue needs."""

from pathlib import Path
from typing import Annotated

import typer

from plateau.cli import options as o
from plateau.cli.app import group

scale = group(
    "scale",
    """
    Workers as jobs of a batch system, as many as the queue needs.

    Works on PLATEAU_REDIS_URL and PLATEAU_BLOBS, as workers do, and hands its environment to them.
    """,
)


@scale.command()
def slurm(
    most: Annotated[int, typer.Option("--max", help="Most workers that run at once.", min=0)],
    least: Annotated[
        int, typer.Option("--min", help="Fewest workers that run, even with nothing to do.", min=0)
    ] = 0,
    worth: Annotated[
        float,
        typer.Option(
            metavar="SECONDS",
            help="Work that a worker is submitted for; one slice that takes longer is enough.",
            min=0.001,
        ),
    ] = 60.0,
    calm: Annotated[
        float,
        typer.Option(
            metavar="SECONDS",
            help="No worker leaves until fewer have been needed for this long.",
            min=0,
        ),
    ] = 60.0,
    idle: Annotated[
        float,
        typer.Option(
            metavar="SECONDS",
            help="No worker leaves until it has had nothing to do for this long.",
            min=0,
        ),
    ] = 30.0,
    from_priority: Annotated[
        int | None,
        typer.Option(
            metavar="PRIORITY",
            help="Jobs of a lower priority start no workers; running workers render them.",
        ),
    ] = None,
    partition: Annotated[
        str | None, typer.Option(help="Partition of Slurm, or several: a,b.")
    ] = None,
    cpus: Annotated[
        int | None,
        typer.Option(help="Processors of each worker, which uses as many threads.", min=1),
    ] = None,
    gpus: Annotated[
        str | None, typer.Option(metavar="N", help="GPUs of each worker: 1, or a100:1.")
    ] = None,
    mem: Annotated[str | None, typer.Option(help="Memory of each worker: 16G.")] = None,
    time: Annotated[
        str | None,
        typer.Option(
            metavar="LIMIT", help="Time limit of each worker: 8:00:00. It leaves before that."
        ),
    ] = None,
    account: Annotated[str | None, typer.Option(help="Account that Slurm charges.")] = None,
    qos: Annotated[str | None, typer.Option(help="Quality of service in Slurm.")] = None,
    sbatch_option: Annotated[
        list[str] | None,
        typer.Option(
            metavar="OPTION",
            help="Any other option for sbatch; may be repeated: --sbatch-option=--nice=100.",
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
        str,
        typer.Option(help="Name of the jobs in Slurm; give two scalers two names."),
    ] = "plateau-worker",
    every: Annotated[
        float, typer.Option(metavar="SECONDS", help="Time between two looks at the queue.", min=0.1)
    ] = 10.0,
    once: Annotated[bool, typer.Option("--once", help="Look once, and end; for cron.")] = False,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Say what would be done, and do nothing.")
    ] = False,
    cancel_on_exit: Annotated[
        bool,
        typer.Option(
            "--cancel-on-exit",
            help="At the end, cancel waiting jobs and ask the workers to leave.",
        ),
    ] = False,
    as_json: o.Json = False,
) -> None:
    """Submit workers to Slurm as the queue needs them, and have them leave when it does not.

    For example:
      plateau scale slurm --max 16 --partition cpu --cpus 16 --mem 32G --time 8:00:00
      plateau scale slurm --max 4 --partition gpu --gpus 1 --name plateau-gpu --from-priority 10
      plateau scale slurm --max 16 --once --dry-run

    It runs until Ctrl-C, on a machine that submits jobs to Slurm. The workers then stay, and leave
    by themselves after ten minutes without work, unless --min asks for some. Started again, it
    knows its jobs by their name and comment. It writes each change as a line to standard error, or
    with --json as an object to standard output. See deploy/slurm/README.md.
    """
    from plateau.commands.scale import Scaling
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
        Scaling(
            limits=Limits(least=least, most=most, worth_s=worth, calm_s=calm, idle_s=idle),
            from_priority=from_priority,
            name=name,
            options=tuple(options),
            script=script,
            worker_env=worker_env,
            every_s=every,
            once=once,
            dry_run=dry_run,
            cancel_on_exit=cancel_on_exit,
            as_json=as_json,
        )
    )
