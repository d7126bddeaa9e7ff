"""Whatever is uploaded, the check either describes it or refuses it in words, and stays inside.

``LONG_TESTS=1`` tries 12,000 uploads instead of 300, and then all the costliest that are known; it
takes some minutes. The uploads are drawn from ``FUZZ_SEED`` (0 by default), and are the same in
every run with one seed and one version of Hypothesis. What was found is a small test of its own in
`test_bundle.py`.
"""

import io
import os
import resource
import stat
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, seed, settings

from plateau.farm.bundle import (
    CODES,
    BundleError,
    BundleLimits,
    SceneSummary,
    inspect_bundle,
    unpack_bundle,
)
from plateau.farm.bundle.archive import Archive
from plateau.farm.bundle.references import Reference
from plateau.farm.bundle.walk import read_scene
from tests.support import long_tests
from tests.support.scenes.bundle_strategies import CANARY, Upload, uploads
from tests.support.scenes.bundles import scene, zipped

SEED = int(os.environ.get("FUZZ_SEED", "0"))
#: Hypothesis remembers all that it drew in a round, some 60 kB a case.
ROUNDS, CASES = (12, 1000) if long_tests.WANTED else (1, 300)

#: Generous: a case takes milliseconds on a quiet machine, and nothing may take minutes.
MOST_S = 20.0
#: More than the process had before: the check holds no file in memory, and no wide tree.
MOST_BYTES = 512 * 2**20
LONGEST_MESSAGE = 2500  # names of an archive are up to 1024 bytes, and two may be told
LIMITS = BundleLimits()


def check_words(error: BundleError) -> None:
    """A refusal has a known code, and one paragraph that a person can read."""
    message = str(error)
    assert error.code in CODES
    assert 10 < len(message) < LONGEST_MESSAGE
    assert message == message.strip()
    assert message.isprintable() or not any(c in message for c in "\n\r\t\0\x1b")
    message.encode()  # nothing that JSON or a log could choke on


def check_summary(summary: SceneSummary) -> None:
    assert summary.kind in ("xml", "zip")
    assert 1 <= summary.width * summary.height <= LIMITS.max_pixels
    assert min(summary.width, summary.height, summary.sensors) >= 1
    assert 1 <= summary.files <= LIMITS.max_entries
    assert summary.bytes_unpacked <= LIMITS.max_unpacked_bytes


def inspect(upload: Upload) -> SceneSummary | BundleError:
    try:
        summary = inspect_bundle(
            io.BytesIO(upload.content), parameters=upload.parameters, sensor=upload.sensor
        )
    except BundleError as error:
        check_words(error)
        return error
    check_summary(summary)
    return summary


def unpack(upload: Upload, folder: Path) -> str | BundleError:
    try:
        return unpack_bundle(io.BytesIO(upload.content), folder)
    except BundleError as error:
        check_words(error)
        return error


def references(upload: Upload, summary: SceneSummary) -> list[Reference]:
    if summary.kind == "xml":
        return []  # nothing but itself to refer to: it would not have passed
    tree = Archive(io.BytesIO(upload.content), len(upload.content), LIMITS)
    entry = tuple(summary.entry.split("/"))
    return list(read_scene(tree, entry, upload.parameters, LIMITS).references)


def check_disk(top: Path, folder: Path) -> tuple[int, int]:
    """Files and bytes below the folder: plain ones alone, and nothing beside it."""
    files = size = 0
    for path in top.rglob("*"):
        mode = path.lstat().st_mode
        assert stat.S_ISREG(mode) or stat.S_ISDIR(mode), path
        assert path in (folder, folder.parent) or folder in path.parents
        assert not stat.S_IMODE(mode) & 0o7022, path
        if stat.S_ISREG(mode):
            files += 1
            size += path.lstat().st_size
    return files, size


def check_unpacked(upload: Upload, found: SceneSummary | BundleError) -> str:
    """Unpack it into a folder of its own; return what came of it, in a word."""
    with tempfile.TemporaryDirectory() as name:
        top = Path(name).resolve()
        folder = top / "around" / "bundle"
        folder.parent.mkdir(mode=0o755)
        entry = unpack(upload, folder)
        files, size = check_disk(top, folder)
        if isinstance(found, BundleError):
            return found.code
        if isinstance(entry, BundleError):
            # Data is first read when it is unpacked: there, and only there, the check may fail.
            assert entry.code == "zip-malformed"
            assert entry.file is not None
            return "damaged"
        assert entry == found.entry
        assert (files, size) == (found.files, found.bytes_unpacked)
        for reference in references(upload, found):
            target = folder.joinpath(*reference.path)
            assert target.is_dir() if reference.role == "folder" else target.is_file()
            assert folder == target.resolve() or folder in target.resolve().parents
        return "good"


def peak_bytes() -> int:
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024


@pytest.mark.parametrize("round_", range(ROUNDS))
@pytest.mark.timeout(1200)
def test_any_upload_is_described_or_refused_in_words_and_stays_inside(
    round_: int, capsys: pytest.CaptureFixture[str]
) -> None:
    outcomes: Counter[str] = Counter()
    before = peak_bytes()

    @seed(1000 * SEED + round_)
    @settings(
        max_examples=CASES, deadline=None, database=None, suppress_health_check=list(HealthCheck)
    )
    @given(upload=uploads())
    def check(upload: Upload) -> None:
        started = time.monotonic()
        outcomes[check_unpacked(upload, inspect(upload))] += 1
        assert time.monotonic() - started < MOST_S
        assert not Path(CANARY).exists()

    print(f"FUZZ_SEED={SEED}")
    check()
    with capsys.disabled():
        told = ", ".join(f"{count} {what}" for what, count in outcomes.most_common())
        print(f"\n{sum(outcomes.values())} uploads of FUZZ_SEED={SEED}: {told}")
    assert peak_bytes() - before < MOST_BYTES
    # And the uploads were worth it: some came through, and most rules had work to do
    assert outcomes["good"] > CASES / 100
    assert len(outcomes) > 15


def _scene_of(*body: str) -> dict[str, bytes]:
    return {"scene.xml": scene(*body), "a.ply": b""}


def _defaults(count: int) -> list[str]:
    return [f'<default name="p{number:03}" value=""/>' for number in range(count)]


#: Uploads that cost the check as much as the limits allow, or would without one of them.
COSTLY = {
    "elements": lambda: _scene_of("<a/>" * 490_000),
    "references": lambda: _scene_of('<string name="filename" value="a.ply"/>' * 490_000),
    "comments": lambda: _scene_of("<!--" + ("x" * 1000 + "<") * 31_000 + "-->"),
    "a long text": lambda: _scene_of(f'<a b="{"x" * 30_000_000}"/>'),
    "attributes of one element": lambda: _scene_of(
        "<a " + " ".join(f'b{number}=""' for number in range(2_000_000)) + "/>"
    ),
    "attributes of many elements": lambda: _scene_of(
        *(
            "<a " + " ".join(f'b{number}=""' for number in range(first, first + 50_000)) + "/>"
            for first in range(0, 2_000_000, 50_000)
        )
    ),
    "parameters of long names": lambda: _scene_of(
        *(f'<default name="a{number}{"x" * 40_000}" value=""/>' for number in range(250)),
        r'<a b="\$"/>' * 400_000,
    ),
    "parameters to look for": lambda: _scene_of(*_defaults(250), r'<a b="\$" c="\$"/>' * 400_000),
    "parameters to put in": lambda: _scene_of(
        *_defaults(250),
        '<a b="{}"/>'.format("".join(f"$p{number:03}" for number in range(250))) * 20_000,
    ),
    "parameters of long values": lambda: _scene_of(
        f'<default name="v" value="{"x" * 60_000}"/>',
        *_defaults(250),
        '<a b="$v{}"/>'.format("".join(f"$p{number:03}" for number in range(250))) * 20_000,
    ),
    "includes in includes": lambda: {
        **_scene_of('<include filename="0.xml"/>'),
        **{
            f"{level}.xml": scene(*[f'<include filename="{level + 1}.xml"/>'] * 2, sensor="")
            for level in range(13)
        },
        "13.xml": scene("<a/>" * 9000, sensor=""),
    },
    "folders": lambda: {
        "scene.xml": scene(),
        **{f"{number}/" + "d/" * 30 + "x": b"" for number in range(9_990)},
    },
}
INSPECT = """
import io, resource, sys
from plateau.farm.bundle import BundleError, BundleLimits, inspect_bundle
upload = io.BytesIO(sys.stdin.buffer.read())
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
try:
    inspect_bundle(upload, limits=BundleLimits(max_ratio=1e9))
except BundleError as error:
    assert error.code in ("xml-too-large", "too-many-entries"), error
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
"""


@pytest.mark.parametrize("what", COSTLY if long_tests.WANTED else ["a long text"])
def test_the_costliest_upload_is_cheap_enough(what: str) -> None:
    upload = zipped(COSTLY[what]()).getvalue()
    started = time.monotonic()
    done = subprocess.run(
        [sys.executable, "-c", INSPECT],
        input=upload,
        stdout=subprocess.PIPE,
        timeout=120,
        check=True,
    )
    assert time.monotonic() - started < 3 * MOST_S
    assert int(done.stdout) * 1024 < MOST_BYTES
