"""The docs name everything that a user can set, call or be told."""

from pathlib import Path

import pytest
import typer.main

from farm.settings import Settings
from plateau.cli import app

ROOT = Path(__file__).parents[1]


@pytest.mark.parametrize("setting", Settings.model_fields)
def test_every_setting_is_in_the_docs(setting: str) -> None:
    assert f"`PLATEAU_{setting.upper()}`" in (ROOT / "docs" / "operations.md").read_text()


@pytest.mark.parametrize("command", typer.main.get_command(app).commands)  # type: ignore[attr-defined]
def test_every_command_is_in_the_readme(command: str) -> None:
    assert f"plateau {command}" in (ROOT / "README.md").read_text()
