"""The settings that must fit each other."""

import pytest
from pydantic import ValidationError

from farm.settings import Settings


@pytest.mark.parametrize(
    ("lease_s", "heartbeat_s"), [("15", 5), ("600", 5), ("6", 2), ("0.75", 0.25)]
)
def test_heartbeats_follow_a_shorter_lease(
    monkeypatch: pytest.MonkeyPatch, lease_s: str, heartbeat_s: float
) -> None:
    monkeypatch.delenv("PLATEAU_HEARTBEAT_S", raising=False)
    monkeypatch.setenv("PLATEAU_LEASE_S", lease_s)
    assert Settings().heartbeat_s == heartbeat_s


def test_a_lease_lasts_some_heartbeats(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("PLATEAU_LEASE_S", raising=False)
    monkeypatch.setenv("PLATEAU_HEARTBEAT_S", "6")
    assert Settings().heartbeat_s == 6
    monkeypatch.setenv("PLATEAU_HEARTBEAT_S", "20")
    says = "set PLATEAU_LEASE_S to 50 at least, or PLATEAU_HEARTBEAT_S to 6 at most"
    with pytest.raises(ValidationError, match=says):
        Settings()
    monkeypatch.setenv("PLATEAU_LEASE_S", "50")
    assert Settings().heartbeat_s == 20
