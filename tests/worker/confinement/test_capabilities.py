"""What a render child keeps of root's powers: nothing, or what Python needs to run at all."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(
    sys.platform != "linux" or os.geteuid() != 0, reason="only root has powers to lose"
)

#: Gives the powers up, and says what it can do then with a file of another user's.
TRY = """
import os
import sys
from pathlib import Path
from plateau.worker.confinement.capabilities import drop_capabilities
file = Path(sys.argv[1])
drop_capabilities(*[file] if sys.argv[2] == "needed" else [])
for what in (file.read_text, lambda: file.write_text("changed"), lambda: os.setuid(1)):
    try:
        what()
        print("done")
    except PermissionError:
        print("refused")
"""


@pytest.mark.parametrize(
    ("is_needed", "outcomes"),
    [("needed", ["done", "refused", "refused"]), ("other", ["refused", "refused", "refused"])],
)
def test_root_may_read_others_files_where_python_is_one_of_them(
    is_needed: str, outcomes: list[str], tmp_path: Path
) -> None:
    # Given a folder that only its owner may enter, as the home of a user whose Python root runs
    home = tmp_path / "home"
    home.mkdir(mode=0o700)
    file = home / "python.py"
    file.write_text("as it was")
    for path in (home, file):
        os.chown(path, 65534, 65534)
    # When a child of root's gives its powers up
    done = subprocess.run(
        [sys.executable, "-c", TRY, file, is_needed], capture_output=True, text=True, check=True
    )
    # Then it can read what it needs, and do nothing else that root can
    assert done.stdout.split() == outcomes
    assert file.read_text() == "as it was"
