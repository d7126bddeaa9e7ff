"""GPUs: Blender itself says which there are, and what it does not find is refused in words."""

import json
import subprocess
import sys

from plateau.farm.model.renderers import CYCLES, VARIANTS
from plateau.worker.supervisor.variants import probe

GPUS = [known.own_name for known in VARIANTS.values() if known.renderer == CYCLES and known.on_gpu]


def _found() -> dict[str, list[str]]:
    command = [sys.executable, "-m", "plateau.worker.renderers.cycles.devices"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    found: dict[str, list[str]] = json.loads(done.stdout)
    return found


def test_the_farm_has_a_variant_for_what_blender_may_find():
    from plateau.worker.renderers.cycles.devices import KINDS

    assert list(KINDS) == GPUS
    assert _found().keys() <= KINDS.keys()


def test_a_device_that_is_not_there_renders_nothing_and_says_so():
    missing = next(kind for kind in reversed(GPUS) if kind not in _found())
    tried = probe(f"cycles:{missing}", None)
    assert not tried.ok
    assert tried.detail.endswith(f"Blender finds no device for {missing}")


def test_doctor_says_what_blender_finds():
    command = [sys.executable, "-m", "plateau", "doctor", "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    checks = {one["name"]: one for one in json.loads(done.stdout)["checks"]}
    assert checks["cycles:cpu"]["ok"]
    found = _found()
    said = checks["Cycles on GPUs"]
    assert said["ok"] == bool(found)
    assert all(f"cycles:{kind}" in said["detail"] for kind in found)
    assert found or said["detail"] == "Blender finds no device"
