"""What the machine must give before anything is started: folders to write into, and open files."""

import os
import resource
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import Final

from plateau.errors import CommandFailed
from plateau.farm.process.settings import Settings
from plateau.farm.redis.embedded import LONGEST_TEMPORARY, socket_in
from plateau.files.out_folder import make, try_writing
from plateau.processes.data_folder import DataFolder

#: Files that one process of a small farm may come to have open.
_OPEN_FILES: Final = 256


def check_ground(
    settings: Settings, *, caches: bool, has_redis: bool = False, data: Path | None = None
) -> None:
    """Raise `CommandFailed` where a process would fail on its machine, or wait for ever.

    Parameters
    ----------
    settings : Settings
    caches : bool
        Whether the process renders, and so writes into the cache.
    has_redis : bool
        Whether it starts a Redis of its own.
    data : Path, optional
        Its data folder, where that is not a temporary one.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft != resource.RLIM_INFINITY and soft < _OPEN_FILES:
        with suppress(ValueError, OSError):
            resource.setrlimit(resource.RLIMIT_NOFILE, (_OPEN_FILES, hard))
            soft = _OPEN_FILES
        if soft < _OPEN_FILES:
            raise CommandFailed(
                f"a process may open {soft} files here, and Plateau needs {_OPEN_FILES}: allow "
                f"more (`ulimit -n {4 * _OPEN_FILES}`)"
            )
    named = os.environ.get("TMPDIR")
    if named and not Path(named).is_dir():
        raise CommandFailed(f"TMPDIR names {named}, which is no folder: let it name another one")
    try:
        if named:
            try_writing(Path(named), "TMPDIR")
        temporary = tempfile.gettempdir()
    except OSError:
        raise CommandFailed("there is no temporary folder: name one with TMPDIR") from None
    is_in_data = data is not None and socket_in(DataFolder(data).redis) is not None
    if has_redis and not is_in_data and len(os.fsencode(temporary)) > LONGEST_TEMPORARY:
        raise CommandFailed(
            f"{temporary} is too long for the path of a socket: let TMPDIR name a folder of "
            f"{LONGEST_TEMPORARY} characters at most, such as /tmp"
        )
    if caches:
        make(settings.cache, "PLATEAU_CACHE")
        try_writing(settings.cache, "PLATEAU_CACHE")
