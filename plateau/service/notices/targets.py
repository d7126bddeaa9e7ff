"""The targets of notices: names that the farm's operator gives to URLs of apprise."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from pydantic import TypeAdapter, ValidationError

from plateau.farm.model.errors import FarmError
from plateau.farm.model.place_names import PlaceName
from plateau.farm.process.settings import Settings

_NAME: Final = TypeAdapter(PlaceName)


class BadTargets(FarmError):
    """The settings of targets cannot be used; the message shows no URL."""


class UnknownTarget(FarmError):
    """No target has this name."""

    def __init__(self, name: str, known: Mapping[str, str]) -> None:
        names = ", ".join(sorted(known)) or "none"
        super().__init__(f"there is no target {name!r}; PLATEAU_NOTIFY_FILE names: {names}")


@dataclass(frozen=True)
class Targets:
    """Who can be notified, and who is notified of every job."""

    urls: Mapping[str, str] = field(default_factory=dict, repr=False)  #: by name; secret
    always: tuple[str, ...] = ()
    troubles: tuple[str, ...] = ()  #: those that are notified of the farm's troubles

    def with_always(self, asked: tuple[str, ...]) -> tuple[str, ...]:
        """The names that a job asks for, with those of every job; or `UnknownTarget`."""
        for name in asked:
            self.url(name)
        return tuple(sorted({*asked, *self.always}))

    def url(self, name: str) -> str:
        """The URL of a target, or `UnknownTarget`."""
        if name not in self.urls:
            raise UnknownTarget(name, self.urls)
        return self.urls[name]


def read_targets(settings: Settings) -> Targets:
    """The targets of these settings.

    Raises
    ------
    BadTargets
        The file cannot be read, a line of it is not ``NAME URL``, or ``PLATEAU_NOTIFY`` or
        ``PLATEAU_NOTIFY_TROUBLES`` names a target that it lacks.
    """
    path = settings.notify_file
    try:
        urls = {} if path is None else _urls(path)
    except (OSError, ValueError) as error:
        raise BadTargets(f"PLATEAU_NOTIFY_FILE: {error}") from None
    for setting in ("notify", "notify_troubles"):
        for name in getattr(settings, setting):
            if name not in urls:
                raise BadTargets(f"PLATEAU_{setting.upper()}: {UnknownTarget(name, urls)}")
    return Targets(urls, settings.notify, settings.notify_troubles)


def _urls(path: Path) -> dict[str, str]:
    """The URLs of a file by their names; blank lines and those that begin with # do not count."""
    found: dict[str, str] = {}
    for number, line in enumerate(map(str.strip, path.read_text(encoding="utf-8").splitlines()), 1):
        if not line or line.startswith("#"):
            continue
        name, _, url = line.partition(" ")
        if not _is_name(name) or "://" not in url or name in found:
            raise ValueError(
                f"line {number} of {path} must be a new name, a blank and a URL of apprise"
            )
        found[name] = url.strip()
    return found


def _is_name(text: str) -> bool:
    try:
        _NAME.validate_python(text)
    except ValidationError:
        return False
    return True
