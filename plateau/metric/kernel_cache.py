"""Where compiled kernels are kept; known without loading the compiler."""

import hashlib
import os
from functools import cache
from pathlib import Path

from platformdirs import user_cache_path

_PACKAGE = Path(__file__).parent / "compiled"
#: Files of the metric whose code or constants a kernel may contain.
_SOURCES = ("*.py", "compiled/*.py", "cvvdp/*.py", "cvvdp/*.json")


@cache
def cache_folder() -> Path | None:
    """Return the folder of compiled kernels; None if no folder is writable.

    Its parent is ``NUMBA_CACHE_DIR`` if that is set, else the package's own ``__pycache__``, else
    the user's cache folder. Its name is a digest of the sources, because numba's cache does not
    notice a change of a constant or of an inlined function in another file.
    """
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    places = (
        [Path(chosen)] if chosen else [_PACKAGE / "__pycache__", user_cache_path("plateau-kernels")]
    )
    for place in places:
        folder = place / f"kernels-{_fingerprint()}"
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(folder, os.W_OK | os.X_OK):
            return folder
    return None


def are_compiled() -> bool:
    """Return whether kernels of this version were compiled here before."""
    folder = cache_folder()
    return folder is not None and any(folder.rglob("*.nbi"))


def _fingerprint() -> str:
    """Return a digest of every source whose code or constants a kernel may contain."""
    digest = hashlib.sha256()
    for source in sorted(file for kind in _SOURCES for file in _PACKAGE.parent.glob(kind)):
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]
