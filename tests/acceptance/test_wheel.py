"""The distribution: what a wheel holds, and what works where nothing but the wheel is installed."""

import json
import os
import shutil
import subprocess
import sys
import tarfile
import zipfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from importlib.metadata import metadata
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from tests.support.farms.real_farm import RealFarm

ROOT = Path(__file__).parents[2]
UV = Path(sys.executable).with_name("uv")
CONSTRAINTS = ROOT / "constraints.txt"

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
    "scale slurm --max 1": "farm",
}
#: What can be imported with each extra: whole packages, and modules.
BRINGS = {
    "farm": (
        "farm.blobs",
        "farm.ledger",
        "farm.redis",
        "farm.sweep",
        "processes.redis_at_hand",
    ),
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
def install(wheel: Path) -> Iterator[Callable[[str], Path]]:
    """Installs the wheel with these extras into an empty environment; returns its programs."""
    with ExitStack() as environments:

        def install(extras: str) -> Path:
            # Some have 600 MB, so they do not stay as pytest's own folders do.
            made = environments.enter_context(TemporaryDirectory(prefix="plateau-wheel-"))
            folder = Path(made) / "environment"
            uv("venv", "--python", sys.executable, folder)
            constraints = ("--constraint", CONSTRAINTS)
            uv("pip", "install", "--python", folder, *constraints, f"{wheel}{extras}")
            return folder / "bin"

        yield install


@pytest.fixture(scope="module")
def base(install: Callable[[str], Path]) -> Path:
    """The programs of an environment with the base alone."""
    return install("")


@pytest.fixture
def run(tmp_path: Path) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Runs a program in an empty folder, without what this process has in its environment."""

    def run(*command: str | Path, **environment: str) -> subprocess.CompletedProcess[str]:
        plain = {"PATH": "/usr/bin:/bin", "HOME": str(tmp_path / "home"), **environment}
        (tmp_path / "empty").mkdir(exist_ok=True)
        return subprocess.run(
            command,
            cwd=tmp_path / "empty",
            env=plain,
            capture_output=True,
            text=True,
            timeout=200,
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
    assert {"plateau/py.typed", "plateau/scale/worker.sbatch"} < files
    assert {"plateau/scenes/box/scene.xml", "plateau/service/page/index.html"} < files
    assert "plateau/metric/cvvdp/castle_csf.json" in files
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
        [entry_points] = [name for name in names if name.endswith("/entry_points.txt")]
        assert "plateau = plateau.commands:main" in archive.read(entry_points).decode()
    about = {name for name in names if name.startswith("plateau-") and ".dist-info/" in name}
    assert names - about == files


def test_the_source_distribution_holds_files_where_the_checkout_has_links(
    built: Path, wheel: Path
) -> None:
    [path] = built.glob("*.tar.gz")
    with tarfile.open(path) as archive:
        members = archive.getmembers()
    assert not [one.name for one in members if one.issym() or one.islnk()]
    packed = {one.name.partition("/")[2] for one in members if one.isfile()}
    with zipfile.ZipFile(wheel) as built_of_it:
        assert {name for name in built_of_it.namelist() if name.startswith("plateau/")} <= packed
    assert not [name for name in packed if name.startswith(("tests/", "bench/"))]


@pytest.mark.long
def test_the_whole_of_it_renders_a_scene_outside_the_repository(
    install: Callable[[str], Path], run: Callable[..., subprocess.CompletedProcess[str]]
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
    assert {Path(name).name for name in about["files"]} == {
        *("image.exr", "image.png", "difference.png", "noise.png"),
        *("curve.csv", "curve.svg", "summary.txt", "summary.json"),
    }
    found = run(programs / "python", "-c", "import plateau.worker; print(plateau.worker.__file__)")
    assert found.stdout.startswith(str(programs.parent))


@pytest.mark.parametrize("extra", BRINGS)
@pytest.mark.long
def test_an_extra_brings_what_its_part_imports(
    extra: str,
    install: Callable[[str], Path],
    run: Callable[..., subprocess.CompletedProcess[str]],
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


def test_the_base_lacks_what_a_farm_is_made_of(
    base: Path, run: Callable[..., subprocess.CompletedProcess[str]]
) -> None:
    program = f"""
from importlib.util import find_spec
print(*(name for name in {HEAVY} if find_spec(name)))
import sys
from plateau import Client
import plateau.commands
print(*(name for name in sys.modules if name.startswith("plateau.farm.ledger")))
"""
    done = run(base / "python", "-c", program)
    assert (done.stdout.split(), done.stderr) == ([], "")


def test_the_base_is_a_client_and_a_command_line(
    staffed: RealFarm, base: Path, run: Callable[..., subprocess.CompletedProcess[str]]
) -> None:
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
    assert "submit" in run(plateau, "--help").stdout
    assert job in run(plateau, "list", **where).stdout
    assert "converged" in run(plateau, "show", job[:6], **where).stdout
    fetched = run(plateau, "fetch", job, "-o", "out", **where)
    assert fetched.returncode == 0
    assert {Path(line).name for line in fetched.stdout.splitlines()} == {
        *("image.exr", "image.png", "difference.png", "noise.png"),
        *("curve.csv", "curve.svg", "summary.txt", "summary.json"),
    }
    assert fetched.stderr == ""


def test_a_command_that_needs_more_says_which_extra_to_install(
    base: Path, run: Callable[..., subprocess.CompletedProcess[str]]
) -> None:
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
    known = set(metadata("plateau").get_all("Provides-Extra"))
    assert said.keys() == NEEDS.keys(), done.stderr
    for command, extras in NEEDS.items():
        code, text = said[command]
        assert code == 1, (command, text)
        assert text.count("\n") == 1, text
        assert text.endswith(f", which is not installed: pip install 'plateau[{extras}]'\n"), text
        assert set(extras.split(",")) <= known
