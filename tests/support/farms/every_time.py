"""Monitors that save and show at every point of the curve, however little is new."""

from typing import Final

import pytest

#: Constants by module and name, as `start_armed` takes them.
EVERY_TIME: Final = {
    "plateau.service.monitor.known:SAVE_EVERY_S": 0.0,
    "plateau.service.monitor.known:SLICES_PER_CHECKPOINT": 1,
    "plateau.service.monitor.known:SHOW_EVERY_S": 0.0,
    "plateau.service.monitor.known:SHOW_WITHIN_S": 0.0,
}


def save_every_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have the monitors of this process do so."""
    for name, value in EVERY_TIME.items():
        monkeypatch.setattr(name.replace(":", "."), value)
