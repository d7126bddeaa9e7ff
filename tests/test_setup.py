"""`make` on a machine whose proxy has a certificate of its own."""

import os
import shutil
import subprocess
from pathlib import Path

ROOT = Path(__file__).parents[1]
PYTHON = """#!/bin/sh
[ "$1 $2" != "-m venv" ] || {
  mkdir -p .venv/bin
  cp "$0" .venv/bin/python
  printf '#!/bin/sh\\necho invalid peer certificate: UnknownIssuer >&2; exit 2' > .venv/bin/uv
  chmod +x .venv/bin/uv
}
"""


def test_a_proxy_s_certificate_is_named(tmp_path: Path) -> None:
    for file in ("deploy/setup.sh", "deploy/lib.sh", "pyproject.toml", "constraints.txt"):
        (tmp_path / file).parent.mkdir(exist_ok=True)
        shutil.copy(ROOT / file, tmp_path / file)
    python = tmp_path / "python"
    python.write_text(PYTHON)
    python.chmod(0o755)
    done = subprocess.run(
        ["bash", tmp_path / "deploy/setup.sh"],
        env={"PATH": os.environ["PATH"], "PYTHON": str(python)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert "invalid peer certificate: UnknownIssuer\n" in done.stderr
    assert "export SSL_CERT_FILE=/path/of/your/ca.pem, or UV_SYSTEM_CERTS=true" in done.stderr
    assert not (tmp_path / ".venv/made-from").exists()
