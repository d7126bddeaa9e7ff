"""Programs that a test puts first on the PATH."""

import os
from pathlib import Path

import pytest


def put_on_path(script: Path, text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Write a shell script that can be run by its name, before any program of that name."""
    script.write_text(f"#!/bin/sh\n{text}\n")
    script.chmod(0o755)
    monkeypatch.setenv("PATH", f"{script.parent}{os.pathsep}{os.environ['PATH']}")
