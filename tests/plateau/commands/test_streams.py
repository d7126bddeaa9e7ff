"""Commands with the streams and the locale that they were started with."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
import redis

from plateau.farm.ledger.jobs import Jobs
from plateau.farm.model.spec import JobSpec

#: Says on both streams what not all terminals show, and opens a file with an accent.
PROGRAM = r"""
import os, subprocess, sys
from plateau.errors import tell
from plateau.streams import standard_streams
with standard_streams():
    tell("3 \u00d7 4")
    sys.stdin.read()
    open("\u00e9.txt", "w").close()
    print("3 \u00d7 4", os.listdir(), "\udcff")
    if "PYTHONUTF8" in os.environ:  # what is started works in UTF-8
        asked = [sys.executable, "-c", r"print('\u00d7')"]
        assert subprocess.run(asked, capture_output=True).stdout.decode() == "\u00d7\n"
"""
ASCII = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
LATIN_1 = {"PYTHONIOENCODING": "latin-1"}
FULL = "plateau: standard output: No space left on device\n"


@pytest.mark.parametrize(
    ("streams", "locale", "code", "out", "error"),
    [
        ("", {}, 0, "3 × 4 ['é.txt'] ?\n", "plateau: 3 × 4\n"),
        ("", ASCII, 0, "3 ? 4 ['?.txt'] ?\n", "plateau: 3 ? 4\n"),
        ("", LATIN_1, 0, "3 \udcd7 4 ['\udce9.txt'] ?\n", "plateau: 3 \udcd7 4\n"),
        (">&-", {}, 0, "", "plateau: 3 × 4\n"),
        ("2>&-", {}, 0, "3 × 4 ['é.txt'] ?\n", ""),
        (">&- 2>&- <&-", ASCII, 0, "", ""),
        (">/dev/full", {}, 1, "", f"plateau: 3 × 4\n{FULL}"),
        (">/dev/full", ASCII, 1, "", f"plateau: 3 ? 4\n{FULL}"),
        ("2>/dev/full", {}, 0, "3 × 4 ['é.txt'] ?\n", ""),
        (">/dev/full 2>/dev/full", {}, 1, "", ""),
        (">&9", {}, 1, "", "plateau: 3 × 4\n"),
    ],
)
def test_any_stream_and_locale(
    tmp_path: Path, streams: str, locale: dict[str, str], code: int, out: str, error: str
) -> None:
    done = subprocess.run(
        # 9 is a pipe from which nobody reads
        ["bash", "-c", f'exec 9> >(:); wait $!; "{sys.executable}" -c "$PROGRAM" {streams}'],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        env={**os.environ, "PYTHONPATH": str(Path.cwd()), "PROGRAM": PROGRAM, **locale},
        cwd=tmp_path,
        check=False,
    )
    said = (
        done.stdout.decode("utf-8", "surrogateescape"),
        done.stderr.decode("utf-8", "surrogateescape"),
    )
    assert (done.returncode, *said) == (code, out, error)


def test_commands_have_them(api: str, client: redis.Redis) -> None:
    Jobs(client).create(JobSpec(), name="scène 3 × 4", scene_sha256="00")
    command = f"{sys.executable} -m plateau list --url {api}"
    for streams, code, shown in [("", 0, "sc?ne 3 ? 4"), (">/dev/full", 1, FULL), (">&-", 0, "")]:
        done = subprocess.run(
            ["bash", "-c", f"{command} {streams}"],
            capture_output=True,
            env={**os.environ, **ASCII},
            check=False,
        )
        said = (done.stdout + done.stderr).decode("ascii")
        assert (done.returncode, shown in said, "Traceback" in said) == (code, True, False), said
