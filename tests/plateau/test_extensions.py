"""The command line and the API are whole without any extension."""

import subprocess
import sys

WITHOUT = """
import sys
import plateau.extensions
plateau.extensions.EXTENSIONS = ()
import typer
from plateau import Client
from plateau.cli import app
import plateau.farm.sweep
import plateau.service.api.app
print(*typer.main.get_command(app).commands)
print(*(name for name in sys.modules if name.startswith("plateau.study")))
"""


def test_nothing_but_their_names_brings_them_in() -> None:
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT], capture_output=True, text=True, check=True, timeout=120
    )
    commands, modules = done.stdout.split("\n")[:2]
    assert {"render", "keys", "gc"} <= set(commands.split())
    assert "study" not in commands.split()
    assert modules == ""
