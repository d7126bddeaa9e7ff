"""A `blender` program in the place of its Python module: `make test-blender-program`."""

import json
import subprocess
import sys
from pathlib import Path

import psutil

from plateau.farm.model.seeds import Pass
from plateau.worker.renderers.program import command, program_of
from plateau.worker.supervisor.child_process import RenderChild
from plateau.worker.supervisor.child_start import ChildLimits
from plateau.worker.supervisor.variants import probe
from tests.blender.conftest import VARIANT
from tests.support.path_programs import put_on_path


def test_doctor_names_the_release_of_the_program():
    doctor = [sys.executable, "-m", "plateau", "doctor", "--json"]
    done = subprocess.run(doctor, capture_output=True, text=True, check=False)
    checks = {one["name"]: one for one in json.loads(done.stdout)["checks"]}
    assert checks[VARIANT]["ok"]
    release = subprocess.check_output(["blender", "--version"], text=True).split()[1]
    assert checks[VARIANT]["detail"].startswith(f"bpy {release}; rendered a known image")


def test_every_thread_of_the_program_is_confined(blend, tmp_path):
    # Given a render child that has become the program, and has rendered
    limits = ChildLimits(threads=2, memory_bytes=0, timeout_s=120)
    scene = blend("plain")
    child = RenderChild(VARIANT, None, limits, tmp_path / "home", [scene.parent])
    try:
        child.load(scene.parent, scene.name, {}, 0, ())
        child.render([Pass(4, 0)])
        assert Path(psutil.Process(child.pid).exe()) == program_of(VARIANT)
        threads = list(Path(f"/proc/{child.pid}/task").iterdir())
        assert len(threads) > 2
        # Then none of its threads has capabilities, or could start another program
        for thread in threads:
            lines = (thread / "status").read_text().splitlines()
            status = dict(line.split(":\t", 1) for line in lines)
            assert int(status["CapPrm"], 16) == 0
            assert (status["NoNewPrivs"], status["Seccomp"]) == ("1", "2")
    finally:
        child.kill()


def test_a_program_with_another_python_is_refused_in_words():
    # Given a Plateau that was installed for another Python
    whole = command(VARIANT, "plateau.worker.child.probe", [VARIANT])
    whole[whole.index("--") + 1] = "3.9"
    done = subprocess.run(whole, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "and Plateau was installed for 3.9: install Plateau for Python" in done.stdout


def test_a_script_in_the_place_of_the_program_is_refused_in_words(tmp_path, monkeypatch):
    put_on_path(tmp_path / "blender", "exec /usr/bin/blender $@", monkeypatch)
    tried = probe(VARIANT, None)
    assert not tried.ok
    assert "not a script that starts it" in tried.detail
