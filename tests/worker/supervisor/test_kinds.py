"""A worker tests what it renders by a known image, at little cost, and says of which kind it is."""

import json
import os
import shutil
import time
from pathlib import Path

import pytest

from plateau.worker.supervisor import identity
from plateau.worker.supervisor.kinds import Kinds
from plateau.worker.supervisor.variants import Probe, VariantChoice

ANALYTIC = "analytic:numpy"
TRIED = Probe("scalar_rgb", None, ok=True, detail="", bits="0123456789ab")
CHOICE = VariantChoice("scalar_rgb", None, "", (TRIED,))


@pytest.fixture
def kinds(tmp_path: Path) -> Kinds:
    return Kinds(tmp_path, CHOICE)


@pytest.fixture(scope="module")
def tested_once(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What is remembered of a test of the analytic renderer."""
    folder = tmp_path_factory.mktemp("kinds")
    assert Kinds(folder, CHOICE).trouble(ANALYTIC) is None
    return folder / "kinds.json"


@pytest.fixture
def tested(tested_once: Path, tmp_path: Path) -> None:
    shutil.copy(tested_once, tmp_path)


@pytest.fixture
def no_processes(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """From here on every Python process dies at its start."""
    (tmp_path / "dying").mkdir()
    (tmp_path / "dying/sitecustomize.py").write_text("import os\nos.abort()\n", encoding="utf-8")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path / "dying"))


def known(folder: Path, variant: str) -> dict[str, object]:
    content = json.loads((folder / "kinds.json").read_text(encoding="utf-8"))
    return dict(content["known"][variant])


def remember(folder: Path, variant: str, **changed: object) -> None:
    file = folder / "kinds.json"
    content = json.loads(file.read_text(encoding="utf-8"))
    content["known"][variant].update(changed)
    file.write_text(json.dumps(content), encoding="utf-8")


@pytest.mark.usefixtures("no_processes")
def test_what_the_start_found_out_costs_nothing(kinds: Kinds) -> None:
    assert kinds.trouble("scalar_rgb") is None
    assert kinds.named("scalar_rgb").endswith("bits 0123456789ab)")
    assert kinds.names() == (kinds.named("scalar_rgb"),)


def test_another_variant_is_tested_once_for_all_workers_of_the_machine(
    kinds: Kinds, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    assert kinds.trouble(ANALYTIC) is None
    bits = known(tmp_path, ANALYTIC)["bits"]
    request.getfixturevalue("no_processes")
    other = Kinds(tmp_path, CHOICE)
    assert other.trouble(ANALYTIC) is None
    assert other.named(ANALYTIC) == kinds.named(ANALYTIC)
    assert other.named(ANALYTIC).endswith(f"; bits {bits})")
    # And one that cannot be loaded is refused in words
    trouble = other.trouble("scalar_spectral")
    assert trouble is not None
    assert trouble.startswith("scalar_spectral renders nothing here: was ended by SIGABRT")


@pytest.mark.usefixtures("no_processes")
def test_what_was_known_of_a_renderer_that_is_gone_is_forgotten(
    kinds: Kinds, tmp_path: Path
) -> None:
    file = tmp_path / "kinds.json"
    content = json.loads(file.read_text(encoding="utf-8"))
    content["known"]["toy:plain"] = known(tmp_path, "scalar_rgb")
    file.write_text(json.dumps(content), encoding="utf-8")
    assert Kinds(tmp_path, CHOICE).names() == kinds.names()


@pytest.mark.usefixtures("tested")
def test_it_is_tested_again_after_a_day(tmp_path: Path) -> None:
    began = time.time()
    remember(tmp_path, ANALYTIC, checked=began - 25 * 3600)
    assert Kinds(tmp_path, CHOICE).trouble(ANALYTIC) is None
    assert float(str(known(tmp_path, ANALYTIC)["checked"])) >= began


@pytest.mark.usefixtures("tested")
def test_other_bits_than_before_refuse_the_worker(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    remember(tmp_path, ANALYTIC, bits="ba9876543210", checked=86400.0)
    trouble = Kinds(tmp_path, CHOICE).trouble(ANALYTIC)
    assert trouble is not None
    assert trouble.startswith(f"{ANALYTIC} renders other bits of a known image (")
    assert "than on 1970-01-02 (ba9876543210), and nothing was upgraded" in trouble
    # And they are what is normal once the file is gone, as it says
    working = Kinds(tmp_path, CHOICE)
    (tmp_path / "kinds.json").unlink()
    assert Kinds(tmp_path, CHOICE).trouble(ANALYTIC) is None
    # Where libraries were upgraded under a worker, nothing else is to blame
    monkeypatch.setattr(identity, "of", lambda _: {"cpu": "another"})
    assert "upgraded under this worker: start it again" in str(working.trouble(ANALYTIC))


@pytest.mark.usefixtures("tested")
def test_after_an_upgrade_other_bits_are_those_of_another_kind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    remember(tmp_path, ANALYTIC, bits="ba9876543210", checked=86400.0)
    assert {"plateau", "mitsuba", "drjit", "numpy", "cpu"} < identity.of([]).keys()
    new = {**identity.of([]), "cpu": "another"}
    monkeypatch.setattr(identity, "of", lambda _: new)
    assert Kinds(tmp_path, CHOICE).trouble(ANALYTIC) is None


@pytest.mark.parametrize("content", ["", "{", "[]", '{"identity": 1}'])
def test_a_corrupt_file_is_none(tmp_path: Path, content: str) -> None:
    (tmp_path / "kinds.json").write_text(content, encoding="utf-8")
    assert Kinds(tmp_path, CHOICE).trouble("scalar_rgb") is None


def test_an_installation_that_spoils_images_is_refused_in_words(
    kinds: Kinds, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Given a numpy whose arrays of films are too dark
    (tmp_path / "sitecustomize.py").write_text(
        "import numpy\nplain = numpy.array\n"
        "def array(*given, **options):\n"
        "    made = plain(*given, **options)\n"
        "    if made.shape == (32, 32, 4): made[..., :3] *= 0.7\n"
        "    return made\n"
        "numpy.array = array\n",
        encoding="utf-8",
    )
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)
    trouble = kinds.test("scalar_rgb")
    assert trouble is not None
    assert "a known image is wrong in 100% of its blocks: R is 0.7 where 1 is right" in trouble


def test_a_name_says_what_the_bits_depend_on(tmp_path: Path) -> None:
    library = "/usr/lib/libLLVM.so.19.1"
    tried = Probe("llvm_ad_rgb", library, ok=True, detail="", bits="00112233aabb")
    choice = VariantChoice("llvm_ad_rgb", library, "", (tried,))
    named = Kinds(tmp_path, choice).named("llvm_ad_rgb")
    assert named.startswith("mitsuba ")
    assert named.endswith(f"(llvm_ad_rgb; libLLVM.so.19.1; {identity.cpu()}; bits 00112233aabb)")
    assert "," not in named
