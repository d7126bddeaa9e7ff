"""Writes docs/cli.md from the commands' own help: ``make manual``.

A test holds the page to what this makes, so no command or option is missing there.
"""

import inspect
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import typer
import typer.main

from plateau.commands import app, meet_extensions
from plateau.commands.options import rule_options
from plateau.commands.options.spec_options import spec_from_options

meet_extensions()

PAGE: Final = Path(__file__).parents[1] / "docs" / "cli.md"

#: What a user wants to do, what to know first, and the commands for it.
TASKS: Final[tuple[tuple[str, str, tuple[str, ...]], ...]] = (
    (
        "Render and compare on this machine",
        "These commands need no service; `dataset` can use one.",
        ("render", "dataset", "diff", "judge", "doctor"),
    ),
    (
        "Run a service",
        (
            "`plateau up` runs everything on one machine. On several machines, `api`, `monitor` "
            "and `worker` run one process each; [operations.md](operations.md) has the settings."
        ),
        ("up", "api", "monitor", "worker", "gc"),
    ),
    (
        "Submit and follow jobs",
        (
            "These commands talk to a service, by default the one on this machine. Name another "
            "with `--url` or `PLATEAU_URL`. `PLATEAU_KEY` or `PLATEAU_KEY_FILE` has the API key. "
            "A job's id may be shortened, as in git. A batch is several jobs under one name, such "
            "as the frames of an animation: [animation.md](animation.md)."
        ),
        ("submit", "watch", "list", "show", "log", "fetch", "usage"),
    ),
    (
        "Control jobs and workers",
        (
            "With an API key, a submitter controls its own jobs, an admin those of everybody, and "
            "the workers."
        ),
        ("cancel", "pause", "resume", "priority", "delete", "again", "drain"),
    ),
    (
        "Ask observers",
        (
            "An observer study measures from how many samples on people see no difference: "
            "[study.md](study.md)."
        ),
        ("study create", "study list", "study export", "study fit", "study delete"),
    ),
    (
        "Administer a farm",
        "Keys and Redis users decide who may do what.",
        ("keys create", "keys list", "keys rotate", "keys revoke", "redis-acl"),
    ),
)

_BEGIN: Final = """\
# The command line

<!-- Written by `make manual` from the help of the commands. -->

Every command has `--help`. With `--json`, commands print JSON for scripts. `plateau
--install-completion` teaches the shell the names of commands, rules and jobs.

"""

#: Options that many commands share, and what stands in each command's table in their place.
_OF_A_SPEC: Final = (*inspect.signature(spec_from_options).parameters, *rule_options.owners())
_SHORTEST_LIST: Final = 8  #: of a spec's options, from which on a command refers to their table


def manual() -> str:
    """Return the page as it has to be."""
    root = typer.main.get_command(app)
    known = commands()
    parts = [_BEGIN, _contents(), _exit_codes(root.help or "")]
    for title, about, names in TASKS:
        parts += [f"## {title}\n\n{about}\n\n"]
        parts += [_command(name, known[name]) for name in names]
    parts.append(_job_options(known["submit"]))
    return "".join(parts).rstrip() + "\n"


def commands() -> dict[str, Any]:
    """Return every command by its name, in the order of the tasks."""
    found = dict(_commands(typer.main.get_command(app), ""))
    listed = [name for _, _, names in TASKS for name in names]
    missing = sorted({*found} ^ {*listed})
    assert not missing, f"TASKS has to name each command once: {missing}"
    return {name: found[name] for name in listed}


def _commands(group: Any, prefix: str) -> Iterator[tuple[str, Any]]:
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from _commands(command, f"{name} ")
        else:
            command.get_params(typer.Context(command))  # adds the options of the stopping rules
            yield prefix + name, command


def _contents() -> str:
    rows = [
        f"| [{title}](#{_anchor(title)}) | "
        + ", ".join(f"[`{name}`](#{_anchor(f'plateau {name}')})" for name in names)
        + " |\n"
        for title, _, names in TASKS
    ]
    return "| task | commands |\n|---|---|\n" + "".join(rows) + "\n"


def _anchor(title: str) -> str:
    return title.lower().replace(" ", "-")


def _exit_codes(about: str) -> str:
    codes = re.findall(r"^ +(\d+) +(.+)$", about, re.MULTILINE)
    rows = "".join(f"| {code} | {meaning} |\n" for code, meaning in codes)
    return f"## Exit codes\n\n| code | meaning |\n|---|---|\n{rows}\n"


def _command(name: str, command: Any) -> str:
    about, examples = described(command)
    taken = [one for one in command.params if not getattr(one, "hidden", False)]
    arguments = [one for one in taken if one.param_type_name == "argument"]
    options = [one for one in taken if one.param_type_name == "option" and one.name != "help"]
    shared = [one for one in options if one.name in _OF_A_SPEC]
    if len(shared) < _SHORTEST_LIST:
        shared = []
    own = [one for one in options if one not in shared]
    usage = " ".join([name, *map(placeholder, arguments), *(["[OPTIONS]"] if options else [])])
    parts = [f"### plateau {name}\n\n    plateau {usage}\n\n{about}\n\n"]
    if examples:
        parts.append("For example:\n\n" + "".join(f"    {line}\n" for line in examples) + "\n")
    rows = [*map(_argument_row, arguments), *map(_option_row, own)]
    if rows:
        parts.append("| option | default | meaning |\n|---|---|---|\n" + "".join(rows) + "\n")
    if shared:
        names = {one.name for one in shared}
        lacking = [f"`--{one.replace('_', '-')}`" for one in _OF_A_SPEC if one not in names]
        but = f", except {', '.join(lacking)}" if lacking else ""
        parts.append(f"It also takes the [options of a job](#options-of-a-job){but}.\n\n")
    return "".join(parts)


def described(command: Any) -> tuple[str, list[str]]:
    """Return the command's description, and its examples, each a line."""
    examples: list[str] = []
    about: list[str] = []
    for paragraph in re.split(r"\n\n+", inspect.cleandoc(command.help)):
        lines = paragraph.replace("\b\n", "").split("\n")
        if lines[0] == "For example:":
            examples += [line.strip() for line in lines[1:]]
        else:
            about.append("\n".join(lines).strip())
    return "\n\n".join(about), examples


def placeholder(argument: Any) -> str:
    """Return how a usage line names an argument."""
    name = str(argument.metavar or argument.name.upper())
    return name if argument.required or name.startswith("[") else f"[{name}]"


def _argument_row(argument: Any) -> str:
    name = placeholder(argument).strip("[]")
    return f"| `{name}` | {_default(argument)} | {_cell(argument.help)} |\n"


def _option_row(option: Any) -> str:
    names = ", ".join(f"`{one}`" for one in sorted(option.opts, key=len))
    if option.metavar:
        names = names.removesuffix("`") + f" {option.metavar}`"
    return f"| {names} | {_default(option)} | {_cell(option.help)} |\n"


def _default(option: Any) -> str:
    if option.required:
        return "required"
    shown = option.show_default if isinstance(option.show_default, str) else option.default
    if shown is None or isinstance(shown, bool) or shown == ():
        return "–"
    return f"{shown:g}" if isinstance(shown, float) else str(getattr(shown, "value", shown))


def _cell(text: str) -> str:
    return re.sub(r"\s+", " ", text).replace("|", "\\|")


def _job_options(submit: Any) -> str:
    rows = [_option_row(one) for one in submit.params if one.name in _OF_A_SPEC]
    return (
        "## Options of a job\n\n"
        "`render`, `submit` and others take these. They are the fields of a job's spec; "
        "[api.md](api.md) has the spec as JSON, and [stopping.md](stopping.md) the rules.\n\n"
        "| option | default | meaning |\n|---|---|---|\n" + "".join(rows)
    )


if __name__ == "__main__":
    PAGE.write_text(manual(), encoding="utf-8")
