"""GPUs: Blender itself says which there are, and what it does not find is refused in words."""

import json
import subprocess
import sys

import pytest

from plateau.farm.model.renderers import renderers
from plateau.worker.renderers.program import command
from plateau.worker.supervisor.variants import probe
from tests.blender.conftest import VARIANT

GPUS = [one.own_name for one in renderers()["cycles"].variants if one.on_gpu]


def _found() -> dict[str, list[str]]:
    searched = command(VARIANT, "plateau.cycles.devices")
    done = subprocess.run(searched, capture_output=True, text=True, check=True)
    return json.loads(done.stdout.splitlines()[-1])


def test_the_farm_has_a_variant_for_what_blender_finds():
    assert _found().keys() <= set(GPUS)


@pytest.mark.parametrize("kind", GPUS)
def test_a_device_renders_or_says_that_it_is_not_there(kind):
    tried = probe(f"cycles:{kind}", None)
    assert tried.ok or tried.detail.endswith(f"Blender finds no device for {kind}")
    assert tried.ok == (kind in _found())


def test_doctor_says_what_blender_finds():
    doctor = [sys.executable, "-m", "plateau", "doctor", "--json"]
    done = subprocess.run(doctor, capture_output=True, text=True, check=False)
    checks = {one["name"]: one for one in json.loads(done.stdout)["checks"]}
    assert checks["cycles:cpu"]["ok"]
    found = _found()
    said = checks["cycles on GPUs"]
    assert said["ok"] == bool(found)
    assert all(f"cycles:{kind}" in said["detail"] for kind in found)
    assert found or said["detail"] == "it finds no device"
