"""Writes plateau/plateau.1, the man page, from the commands' own help: ``make manual``."""

import re
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

import typer

from plateau.cli import app
from tests import cli_manual

PAGE: Final = Path(__file__).parents[1] / "plateau" / "plateau.1"

_SEE: Final = "docs/cli.md in the sources, and http://127.0.0.1:8713/docs of a running service"


def page() -> str:
    """Return the page as it has to be."""
    root = typer.main.get_command(app)
    about, *rest = re.split(r"\n\n+", root.help or "")
    codes = re.findall(r"^ +(\d+) +(.+)$", "\n".join(rest), re.MULTILINE)
    parts = [
        f'.TH PLATEAU 1 "" "Plateau {version("plateau")}" "User Commands"',
        f".SH NAME\nplateau \\- {_text(_first_sentence(about))}",
        ".SH SYNOPSIS\n.B plateau\n.I COMMAND\n.RI [ OPTIONS ]",
        ".SH DESCRIPTION",
        _text("Every command has --help, and with --json many print JSON for scripts."),
        ".SH COMMANDS",
    ]
    for name, command in cli_manual.commands().items():
        parts += _command(name, command)
    parts.append(".SH EXIT STATUS")
    parts += [f".TP\n{code}\n{_text(meaning)}" for code, meaning in codes]
    parts.append(f".SH SEE ALSO\n{_text(_SEE)}")
    return "\n".join(parts) + "\n"


def _command(name: str, command: Any) -> list[str]:
    about, examples = cli_manual.described(command)
    taken = [one for one in command.params if not getattr(one, "hidden", False)]
    arguments = [one for one in taken if one.param_type_name == "argument"]
    options = [one for one in taken if one.param_type_name == "option" and one.name != "help"]
    usage = " ".join(["plateau", name, *map(cli_manual.placeholder, arguments)])
    parts = [f".SS {_text(usage)}", *(f"{_text(one)}\n.PP" for one in about.split("\n\n"))]
    parts += [_item(cli_manual.placeholder(one).strip("[]"), one.help) for one in arguments]
    for one in options:
        names = ", ".join(sorted(one.opts, key=len))
        parts.append(_item(f"{names} {one.metavar or ''}".strip(), one.help))
    if examples:
        parts += [".PP\nFor example:\n.nf", *map(_text, examples), ".fi"]
    return parts


def _item(name: str, help_: str) -> str:
    return f".TP\n\\fB{_text(name)}\\fP\n{_text(help_)}"


def _first_sentence(about: str) -> str:
    return " ".join(about.split()).split(". ")[0].rstrip(".")


def _text(text: str) -> str:
    """Return plain text as roff reads it: no line of it is a request."""
    escaped = text.replace("\\", "\\e").replace("-", "\\-").replace("`", "")
    lines = re.sub(r"[ \t]*\n[ \t]*", "\n", escaped)
    plain = "".join(one if one.isascii() else f"\\[u{ord(one):04X}]" for one in lines)
    return re.sub(r"(?m)^([.'])", r"\\&\1", plain)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
