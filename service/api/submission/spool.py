"""Where uploads lie while they arrive and are checked."""

import logging
import os
import tempfile
from pathlib import Path

_LOG = logging.getLogger(__name__)


def spool_in(folder: Path) -> None:
    """Have this process's temporary files lie in this folder, unless ``TMPDIR`` names another.

    On many systems ``/tmp`` is memory, which a few bundles of 2 GB would fill. The files have no
    names, so nothing is left of them whoever dies.
    """
    if "TMPDIR" in os.environ:
        return
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        _LOG.warning(
            "uploads lie in %s, since %s cannot be used: %s", tempfile.gettempdir(), folder, error
        )
    else:
        tempfile.tempdir = str(folder)
