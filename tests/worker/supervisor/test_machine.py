"""What a worker says of its machine."""

from dataclasses import dataclass
from pathlib import Path

import pytest

from plateau.farm.model.worker import Machine
from plateau.worker.supervisor.machine import MachineUse, hottest


@dataclass
class Sensor:
    """As psutil describes it."""

    current: float


@pytest.mark.parametrize(
    ("sensors", "expected"),
    [
        ({}, None),
        ({"nvme": [Sensor(80.0)], "acpitz": [Sensor(27.8)]}, None),
        ({"nvme": [Sensor(80.0)], "coretemp": [Sensor(55.0), Sensor(71.5), Sensor(60.0)]}, 71.5),
        ({"k10temp": [Sensor(48.25)]}, 48.25),
    ],
)
def test_the_temperature_is_that_of_the_hottest_core(
    sensors: dict[str, list[Sensor]], expected: float | None
) -> None:
    assert hottest(sensors) == expected


def test_this_machine_is_described(tmp_path: Path) -> None:
    use = MachineUse(tmp_path)
    before = Machine.model_validate(use.now())
    assert (before.disk_bytes, before.temperature_c) == (None, None)
    use.look_at_devices()
    machine = Machine.model_validate(use.now())
    assert machine.disk_bytes
    # Few virtual machines have a sensor
    assert machine.temperature_c is None or 0 < machine.temperature_c < 150
