"""A process imports what it needs and no more: `plateau render` starts four, and waits for them."""

import subprocess
import sys

import pytest

_RENDERERS = frozenset({"mitsuba", "drjit"})
#: What only the processes of a farm need.
_FARMS = frozenset({"redis", "obstore", "numba", "matplotlib", "OpenEXR", "PIL", *_RENDERERS})

#: What only judges need; the files of rules say what they are without it.
_JUDGING = frozenset({"plateau.metric.vdp", "plateau.metric.rules.evidence"})

#: What each process starts with, and what has no business in it.
STARTS = {
    "import plateau.commands": {
        *("pydantic", "redis", "numpy", "fastapi", "matplotlib", "rich", "httpx"),
        *("plateau.farm.bundle", *_RENDERERS),
    },
    "import plateau.rendering.own_farm": {"redis", "numpy", "httpx", "fastapi", *_RENDERERS},
    "import plateau.metric, plateau.picture.diff": {"numba"},
    "import plateau.processes.process, plateau.worker.supervisor.supervisor": {
        *("rich", "numba", *_JUDGING, "fastapi", *_RENDERERS)
    },
    "import plateau.processes.process, plateau.service.monitor.monitor": {
        *("rich", "httpx", "fastapi", "matplotlib", *_RENDERERS)
    },
    "import plateau.processes.standing, plateau.service.api.process": {
        *("rich", "numpy", "PIL", "OpenEXR", *_JUDGING, "numba", "httpx", "matplotlib"),
        *_RENDERERS,
    },
    "from plateau import Client": {
        *("numpy", "fastapi", "pydantic_settings", "plateau.farm.ledger", *_FARMS)
    },
    "import plateau.rendering.follow, plateau.rendering.outputs": {
        *("numpy", "fastapi", "plateau.farm.ledger", *_FARMS)
    },
}


@pytest.mark.parametrize("start", STARTS)
def test_it_imports_nothing_that_it_has_no_use_for(start: str) -> None:
    said = subprocess.run(
        [sys.executable, "-c", f"{start}; import sys; print('\\n'.join(sys.modules))"],
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    ).stdout
    assert not STARTS[start] & set(said.splitlines())
