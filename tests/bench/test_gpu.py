"""The benchmark of GPUs, dry: the same way with the variant that this machine has."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.variants import LLVM, library_for

_DRY = """
import sys
from pathlib import Path
from bench import gpu
from bench.support import report
report.RESULTS = Path(sys.argv.pop(1))
gpu.main()
"""


@pytest.mark.llvm
@pytest.mark.long
def test_a_dry_run_measures_every_figure(tmp_path: Path, cache: Path) -> None:
    environment = {
        **os.environ,
        "PLATEAU_CACHE": str(cache),
        "DRJIT_LIBLLVM_PATH": str(library_for(LLVM)),
    }
    command = [sys.executable, "-c", _DRY, str(tmp_path), "--small", "--variant", LLVM]
    subprocess.run(command, env=environment, check=True, timeout=240)
    report = json.loads((tmp_path / "gpu-small.json").read_text())
    # Two sentences about the method; another one would be an error that a case had met
    assert len(report["notes"]) == 2
    rows = report["tables"]["gpu"][1:]
    found = {
        what: float(value.split()[0]) for case, what, value in rows if case.startswith("BOX, 32×32")
    }
    assert found["equal bits, of 1"] == 1
    assert found["kernel, ratio"] > 0
    assert found["samples of the whole render, spp"] >= 200
    ways = [case for case, what, _ in rows if what.startswith("whole render to 5.0 JOD")]
    assert ways == ["BOX, 32×32, by zones", "BOX, 32×32, by frame"]
