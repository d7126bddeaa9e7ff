"""The commands that the farm's operator lets jobs start at their ends, by name."""

import shlex
from collections.abc import Mapping
from dataclasses import dataclass, field

from plateau.farm.model.errors import FarmError
from plateau.farm.process.named_lines import read_named_lines
from plateau.farm.process.settings import Settings


class BadCommands(FarmError):
    """The file of commands cannot be used."""


class UnknownCommand(FarmError):
    """No command has this name."""

    def __init__(self, name: str, known: Mapping[str, object]) -> None:
        names = ", ".join(sorted(known)) or "none"
        super().__init__(f"there is no command {name!r}; PLATEAU_COMMANDS_FILE names: {names}")


@dataclass(frozen=True)
class AllowedCommands:
    """What may be started: the words of each command by its name, and for how long (s)."""

    words: Mapping[str, tuple[str, ...]] = field(default_factory=dict, repr=False)
    limit_s: float = 3600.0

    def named(self, name: str) -> tuple[str, ...]:
        """The words of a command, or `UnknownCommand`."""
        if name not in self.words:
            raise UnknownCommand(name, self.words)
        return self.words[name]


def read_commands(settings: Settings) -> AllowedCommands:
    """The commands of these settings.

    Raises
    ------
    BadCommands
        The file cannot be read, or a line of it is not ``NAME COMMAND``.
    """
    path = settings.commands_file
    try:
        words = {} if path is None else read_named_lines(path, _words, "a command")
    except ValueError as error:
        raise BadCommands(f"PLATEAU_COMMANDS_FILE: {error}") from None
    return AllowedCommands(words, settings.command_limit_s)


def _words(text: str) -> tuple[str, ...] | None:
    try:
        return tuple(shlex.split(text)) or None
    except ValueError:  # a quote that does not end
        return None
