"""Tests whether this worker can render anything at all; if not, a scene is not to blame."""

import time
from pathlib import Path
from typing import Final

from plateau.farm.process.hang import DiskTest
from plateau.worker.supervisor.kinds import Kinds

#: How long a worker that passed the test is trusted.
_TRUST_S: Final = 30.0
#: A disk that takes longer to write a small file hangs.
ANSWERS_S: Final = 30.0


class Health:
    """Tests this worker: it writes a file into its cache and renders a scene that always works.

    `kinds` has the test of what it renders.
    """

    def __init__(self, cache: Path, kinds: Kinds) -> None:
        self._disk = DiskTest(cache)
        self._kinds = kinds
        self._trusted_until: dict[str, float] = {}

    def trouble(self, variant: str) -> str | None:
        """Return why this worker cannot render with `variant`, or None. Takes some seconds."""
        if time.monotonic() < self._trusted_until.get(variant, 0.0):
            return None
        try:
            trouble = self._disk.trouble(ANSWERS_S) or self._kinds.test(variant)
        except OSError as error:
            trouble = f"cannot start a process: {error.strerror}"
        if trouble is None:
            self._trusted_until[variant] = time.monotonic() + _TRUST_S
        return trouble
