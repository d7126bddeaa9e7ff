"""Monitors that save and show at every point of the curve, however little is new."""

from typing import Final

import pytest

#: Constants by module and name, as `start_armed` takes them.
EVERY_TIME: Final = {
    "plateau.service.judging.checkpoints:_INTERVAL_S": 0.0,
    "plateau.service.judging.checkpoints:_SLICES": 1,
    "plateau.service.monitor.results:_INTERVAL_S": 0.0,
}


def save_every_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have the monitors of this process do so."""
    for name, value in EVERY_TIME.items():
        monkeypatch.setattr(name.replace(":", "."), value)
