"""The distribution: what a wheel holds, and what works where nothing but the wheel is installed."""

import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import zipfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from email import message_from_string
from importlib.metadata import metadata
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from tests.support.api_document import api_document
from tests.support.farms.real_farm import RealFarm
from tests.support.long_tests import rare
from tests.support.missing import missing

ROOT = Path(__file__).parents[2]
UV = Path(sys.executable).with_name("uv")
CONSTRAINTS = ROOT / "constraints.txt"
ABOUT = metadata("plateau")
OWN_PYTHON = "{}.{}".format(*sys.version_info)
#: The Pythons that the metadata names; CI tries them all.
PYTHONS = re.findall(r":: (3\.\d+)$", "\n".join(ABOUT.get_all("Classifier", [])), re.MULTILINE)
Run = Callable[..., subprocess.CompletedProcess[str]]

#: The files of a job's result.
RESULTS = {
    *("image.exr", "image.png", "difference.png", "noise.png"),
    *("curve.csv", "curve.svg", "summary.txt", "summary.json"),
}
#: Files that name Plateau's version, and how.
NAME_THE_VERSION = (
    *("CHANGELOG.md", "CITATION.cff", "deploy/compose.yaml", "deploy/containers/Containerfile"),
    *("deploy/containers/README.md", "deploy/kubernetes/Chart.yaml", "pyproject.toml"),
    "plateau/cycles/addon/plateau_farm/blender_manifest.toml",
)
NAMED = re.compile(
    r'(?:plateau/[$\w]+:|(?<![-\w])(?:v|appV|image\.v)ersion(?: = |: |=)"?|^## )(\d+\.\d+\.\d+)',
    re.MULTILINE,
)

#: What no checkout has when it is fresh.
LEFT_OUT = shutil.ignore_patterns(".*", "__pycache__", "*.egg-info", "build", "demo", "plateau-out")
#: What the base does without: the modules of a farm, of a renderer and of plots.
HEAVY = (
    *("redis", "obstore", "numba", "matplotlib", "mitsuba", "drjit", "OpenEXR", "PIL"),
    *("fastapi", "uvicorn", "prometheus_client", "psutil"),
)
#: Commands, and the extras that each names where the base alone is installed.
NEEDS = {
    "render scenes:box": "all",
    "up": "all",
    "doctor": "all",
    "api": "service",
    "monitor": "service",
    "worker": "worker",
    "diff one.png other.png": "images",
    "judge slices": "monitor",
    "study fit table.csv --plot plot.png": "plot",
    "keys list": "farm",
    "gc": "farm",
    "redis-acl": "farm",
    "render scenes:box --on slurm": "all",
}
#: What can be imported with each extra: whole packages, and modules.
BRINGS = {
    "farm": ("farm.blobs", "farm.ledger", "farm.redis", "farm.sweep", "processes.redis_at_hand"),
    "images": ("farm.images", "picture.diff"),
    "api": ("service.api", "processes.standing"),
    "monitor": ("picture", "service.monitor", "metric"),
    "worker": ("worker",),
}


def uv(*arguments: str | Path, **environment: str) -> None:
    """Run uv on what its cache holds, which `make setup` has filled; else with the registry."""
    env = os.environ | environment
    for more in (["--offline"], []):
        command = [UV, *arguments, *more]
        done = subprocess.run(command, env=env, capture_output=True, text=True, timeout=240)
        if done.returncode == 0:
            return
    pytest.fail(done.stderr)


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A fresh checkout."""
    folder = tmp_path_factory.mktemp("checkout") / "plateau"
    shutil.copytree(ROOT, folder, symlinks=True, ignore=LEFT_OUT)
    return folder


@pytest.fixture(scope="module")
def built(sources: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the source distribution, and the wheel that was built from it."""
    folder = tmp_path_factory.mktemp("dist")
    uv("build", "--out-dir", folder, sources)
    return folder


@pytest.fixture(scope="module")
def wheel(built: Path) -> Path:
    [found] = built.glob("*.whl")
    return found


@pytest.fixture(scope="module")
def install(wheel: Path) -> Iterator[Callable[..., Path]]:
    """Installs the wheel with these extras into an empty environment; returns its programs."""
    with ExitStack() as environments:

        def install(extras: str, python: str = sys.executable) -> Path:
            # Some have 600 MB, so they do not stay as pytest's own folders do.
            made = environments.enter_context(TemporaryDirectory(prefix="plateau-wheel-"))
            folder = Path(made) / "environment"
            uv("venv", "--python", python, folder)
            constraints = ("--constraint", CONSTRAINTS)
            uv("pip", "install", "--python", folder, *constraints, f"{wheel}{extras}")
            return folder / "bin"

        yield install


@pytest.fixture(scope="module")
def base(install: Callable[[str], Path]) -> Path:
    """The programs of an environment with the base alone."""
    return install("")


@pytest.fixture
def run(tmp_path: Path) -> Run:
    """Runs a program in an empty folder, without what this process has in its environment."""

    def run(*command: str | Path, **environment: str) -> subprocess.CompletedProcess[str]:
        plain = {"PATH": "/usr/bin:/bin", "HOME": str(tmp_path / "home"), **environment}
        (tmp_path / "empty").mkdir(exist_ok=True)
        return subprocess.run(
            command, cwd=tmp_path / "empty", env=plain, capture_output=True, text=True, timeout=200
        )

    return run


def test_the_wheel_holds_the_package_and_nothing_else(sources: Path, wheel: Path) -> None:
    package = sources / "plateau"
    files = {
        path.relative_to(sources).as_posix()
        for path in package.rglob("*")
        # But the types that check the page's scripts, and what is installed in Blender.
        if path.is_file() and not path.name.endswith(".d.ts") and "addon" not in path.parts
    }
    assert {"plateau/py.typed", "plateau/engines/slurm/worker.sbatch"} < files
    assert {"plateau/scenes/box/scene.xml", "plateau/service/page/index.html"} < files
    assert "plateau/metric/cvvdp/castle_csf.json" in files
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
        [entry_points] = [name for name in names if name.endswith("/entry_points.txt")]
        assert "plateau = plateau.commands:main" in archive.read(entry_points).decode()
        [about] = [name.removesuffix("METADATA") for name in names if name.endswith("/METADATA")]
        text = message_from_string(archive.read(f"{about}METADATA").decode())
    assert {name for name in names if not name.startswith(about)} == files
    # And what it has of others, with their licences
    licences = {name for name in files if name.endswith(".LICENSE")} | {"LICENSE", "THIRD_PARTY.md"}
    assert set(text.get_all("License-File", [])) == licences
    assert {f"{about}licenses/{name}" for name in licences} <= names
    others = (sources / "THIRD_PARTY.md").read_text()
    assert all(f"`{Path(name).name}`" in others for name in licences if name in files)
    vendored = {Path(name) for name in files if "/vendor/" in name}
    assert {str(one.parent / f"{one.name.split('.')[0]}.LICENSE") for one in vendored} <= licences
    # And the README, which an index shows
    assert text["Description-Content-Type"] == "text/markdown"
    assert text.get_payload() == (sources / "README.md").read_text()


def test_the_source_distribution_holds_files_where_the_checkout_has_links(built: Path) -> None:
    [path] = built.glob("*.tar.gz")
    with tarfile.open(path) as archive:
        members = archive.getmembers()
    assert all(one.isfile() for one in members)
    packed = {one.name.split("/")[1] for one in members}
    assert {"CITATION.cff", "LICENSE", "SECURITY.md", "plateau", "pyproject.toml"} < packed
    assert not {"bench", "metric", "scenes", "service", "tests", "worker"} & packed


@pytest.mark.parametrize("kinds", [["--sdist"], *rare([])], ids=["sources", "both"])
def test_whoever_builds_it_gets_the_same_bytes(
    sources: Path, built: Path, tmp_path: Path, kinds: list[str]
) -> None:
    # Given the same files elsewhere, of another day and for others' eyes
    copy = shutil.copytree(sources, tmp_path / "of-another", symlinks=True)
    for path in filter(Path.is_file, copy.rglob("*")):
        path.chmod(0o600)
        os.utime(path, (1_000_000_000, 1_000_000_000))
    # When they are built
    uv("build", *kinds, "--out-dir", tmp_path / "again", copy)

    # Then the distributions are the same
    def digests(folder: Path) -> dict[str, str]:
        files = folder.glob("plateau-*")
        return {one.name: hashlib.sha256(one.read_bytes()).hexdigest() for one in files}

    again = digests(tmp_path / "again")
    assert len(again) == (1 if kinds else 2)
    assert again.items() <= digests(built).items()


def test_the_version_is_the_same_wherever_it_is_named() -> None:
    named = {file: set(NAMED.findall((ROOT / file).read_text())) for file in NAME_THE_VERSION}
    assert named == {file: {ABOUT["Version"]} for file in named}
    assert api_document()["info"]["version"] == ABOUT["Version"]


@pytest.mark.long
def test_the_whole_of_it_renders_a_scene_outside_the_repository(
    install: Callable[[str], Path], run: Run
) -> None:
    programs = install("[all]")
    size = ("-D", "width=32", "-D", "height=24")
    done = run(
        *(programs / "plateau", "render", "scenes:box", *size, "--json", "-o", "out"),
        *("--rule", "fixed:spp=16", "--step", "8", "--slice-spp", "8", "--variant", "scalar_rgb"),
    )
    assert done.returncode == 0, done.stderr
    about = json.loads(done.stdout)
    assert (about["state"], about["spp"]) == ("converged", 16)
    assert {Path(name).name for name in about["files"]} == RESULTS
    found = run(programs / "python", "-c", "import plateau.worker; print(plateau.worker.__file__)")
    assert found.stdout.startswith(str(programs.parent))


@pytest.mark.parametrize("extra", BRINGS)
@pytest.mark.long
def test_an_extra_brings_what_its_part_imports(
    extra: str, install: Callable[[str], Path], run: Run
) -> None:
    program = f"""
from importlib import import_module
from pkgutil import walk_packages
for name in {BRINGS[extra]}:
    found = import_module(f"plateau.{{name}}")
    for module in walk_packages(getattr(found, "__path__", ()), f"{{found.__name__}}."):
        if not module.name.endswith(".__main__"):
            import_module(module.name)
"""
    done = run(install(f"[{extra}]") / "python", "-c", program)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(
    "version",
    [pytest.param(one, marks=[pytest.mark.long] * (one != OWN_PYTHON)) for one in PYTHONS],
)
def test_the_base_lacks_what_a_farm_is_made_of(
    version: str, base: Path, install: Callable[..., Path], run: Run
) -> None:
    # Given a Python that the metadata names
    python = f"python{version}"
    which = ["env", f"PYENV_VERSION={version}", python, "-c", "import sys; print(sys.executable)"]
    found = subprocess.run(which, capture_output=True, text=True, check=False).stdout.strip()
    if not found and version != OWN_PYTHON:
        missing(f"there is no {python} here: install it, such as by `pyenv install {version}`")
    # When nothing but the base is installed
    program = f"""
from importlib.util import find_spec
print(*(name for name in {HEAVY} if find_spec(name)))
import sys
from plateau import Client
import plateau.commands
print(*(name for name in sys.modules if name.startswith("plateau.farm.ledger")))
"""
    programs = base if version == OWN_PYTHON else install("", found)
    # Then it works without a farm's parts
    done = run(programs / "python", "-W", "error", "-c", program)
    assert (done.stdout.split(), done.stderr) == ([], "")
    assert "submit" in run(programs / "plateau", "--help").stdout


def test_the_base_is_a_client_and_a_command_line(staffed: RealFarm, base: Path, run: Run) -> None:
    where = {"PLATEAU_URL": staffed.url}
    # Given a job that the client has submitted
    program = """
import os, sys
from pathlib import Path
from plateau import Client, FixedSpec, JobSpec
import plateau.scenes
box = Path(plateau.scenes.__file__).parent / "box"
small = {"width": 32, "height": 24}
with Client(os.environ["PLATEAU_URL"]) as client:
    job = client.submit(box, JobSpec(step=8, slice_spp=8, rule=FixedSpec(spp=16), parameters=small))
    job = client.wait(job.id)
    print(job.id, job.state.value, len(client.curve_columns(job.id)["spp"]))
    try:
        client.array(job.id)
    except ImportError as error:
        print(error)
"""
    done = run(base / "python", "-c", program, **where)
    assert done.returncode == 0, done.stderr
    ended, told = done.stdout.splitlines()
    job, *how = ended.split()
    assert how == ["converged", "2"]
    assert told == "this needs OpenEXR, which is not installed: pip install 'plateau[images]'"
    # Then the command line knows it, and fetches all
    plateau = base / "plateau"
    assert job in run(plateau, "list", **where).stdout
    assert "converged" in run(plateau, "show", job[:6], **where).stdout
    fetched = run(plateau, "fetch", job, "-o", "out", **where)
    assert fetched.returncode == 0
    assert {Path(line).name for line in fetched.stdout.splitlines()} == RESULTS
    assert fetched.stderr == ""


def test_a_command_that_needs_more_says_which_extra_to_install(base: Path, run: Run) -> None:
    program = f"""
import json
from pathlib import Path
from typer.testing import CliRunner
from plateau.commands import app, meet_extensions
meet_extensions()
Path("table.csv").write_text("scene,100,200,400\\none,0.9,0.5,0.1\\n")
Path("slices").mkdir()
Path("one.png").touch()
Path("other.png").touch()
for command in {list(NEEDS)}:
    done = CliRunner().invoke(app, command.split(), prog_name="plateau")
    print(json.dumps([command, done.exit_code, done.stderr]))
"""
    done = run(base / "python", "-c", program, PATH="/nowhere")  # nor has the machine a Redis
    said = {
        command: (code, text) for command, code, text in map(json.loads, done.stdout.splitlines())
    }
    known = set(ABOUT.get_all("Provides-Extra", []))
    assert said.keys() == NEEDS.keys(), done.stderr
    for command, extras in NEEDS.items():
        code, text = said[command]
        assert code == 1, (command, text)
        assert text.count("\n") == 1, text
        assert text.endswith(f", which is not installed: pip install 'plateau[{extras}]'\n"), text
        assert set(extras.split(",")) <= known
