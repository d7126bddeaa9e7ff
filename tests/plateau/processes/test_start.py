"""A process imports what it needs and no more: `plateau render` starts four, and waits for them."""

import subprocess
import sys

import pytest

#: What each process starts with, and what has no business in it.
STARTS = {
    "import plateau.cli": {"pydantic", "redis", "numpy", "rich.console", "httpx"},
    "import plateau.commands.render": {"redis", "numpy", "httpx", "fastapi", "mitsuba"},
    "import plateau.processes.process, worker.supervisor": {
        "rich",
        "numba",
        "metric",
        "fastapi",
        "mitsuba",
    },
    "import plateau.commands.serve, service.monitor": {"rich", "httpx", "fastapi", "mitsuba"},
    "import plateau.commands.serve, service.app": {
        *("rich", "numpy", "PIL", "OpenEXR", "metric", "numba", "httpx", "matplotlib", "mitsuba"),
    },
    "import plateau.client": {"numpy", "fastapi", "mitsuba"},
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
