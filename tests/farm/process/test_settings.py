"""The settings that must fit each other."""

from typing import get_args

import pytest
from pydantic import ValidationError

from plateau.farm.process.settings import Settings

NUMBERS = {
    name: field
    for name, field in Settings.model_fields.items()
    if {int, float} & {field.annotation, *get_args(field.annotation)}
}


@pytest.mark.parametrize("name", NUMBERS)
def test_each_number_has_bounds(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    # What has none is refused late, by a clock, by Redis, or by the kernel, in their words
    for absurd in ("inf", "nan", "1e300", "9" * 30, "-1"):
        monkeypatch.setenv(f"PLATEAU_{name.upper()}", absurd)
        with pytest.raises(ValidationError, match=name):
            Settings()


@pytest.mark.parametrize(
    ("lease_s", "heartbeat_s"), [("15", 5), ("600", 5), ("6", 2), ("0.75", 0.25)]
)
def test_heartbeats_follow_a_shorter_lease(
    monkeypatch: pytest.MonkeyPatch, lease_s: str, heartbeat_s: float
) -> None:
    monkeypatch.setenv("PLATEAU_LEASE_S", lease_s)
    assert Settings().heartbeat_s == heartbeat_s


def test_a_path_may_begin_at_home(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", "/home/ada")
    monkeypatch.setenv("PLATEAU_DATA", "~/farm")
    monkeypatch.setenv("PLATEAU_KEY_FILE", "~/.key")
    monkeypatch.setenv("PLATEAU_SCENE_ROOTS", "assets=~/assets")
    settings = Settings()
    assert (str(settings.data), str(settings.key_file)) == ("/home/ada/farm", "/home/ada/.key")
    assert str(settings.scene_roots[0].path) == "/home/ada/assets"
