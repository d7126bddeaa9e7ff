"""What a render child may not do, tried by code in a real one and by scenes that take too much."""

import os
import platform
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from textwrap import dedent

import numpy as np
import psutil
import pytest

from plateau.farm.bundle import BundleLimits
from plateau.farm.model.seeds import Pass
from plateau.worker.confinement.seccomp import refuse_calls
from plateau.worker.renderers.contract import SceneError
from plateau.worker.supervisor import child_start
from plateau.worker.supervisor.child_process import ChildDied, RenderChild
from plateau.worker.supervisor.child_start import ChildLimits
from tests.support.missing import of_root
from tests.support.variants import VARIANTS, library_for

BOX = Path(__file__).parents[3] / "plateau" / "scenes" / "box"
SMALL = {"width": "16", "height": "12"}


Start = Callable[..., RenderChild]


@pytest.fixture
def child(tmp_path: Path) -> Iterator[Start]:
    """Starts real render children, and ends them."""
    with ExitStack() as started:

        def start(variant: str = "scalar_rgb", **tighter: int) -> RenderChild:
            given = {"threads": 2, "memory_bytes": 8 << 30, **tighter}
            limits, home = ChildLimits(**given, timeout_s=120), tmp_path / "home"
            child = RenderChild(variant, library_for(variant), limits, home, [BOX, tmp_path])
            started.callback(child.kill)
            child.await_ready()
            return child

        yield start


@of_root
@pytest.mark.parametrize("variant", VARIANTS)
def test_a_confined_child_renders(child: Start, variant: str, tmp_path: Path) -> None:
    confined = child(variant)
    process = psutil.Process(confined.pid)
    # It works in a folder of its own, then in the scene's
    assert process.cwd() == str(tmp_path / "home")
    for size in (SMALL, {"width": "64", "height": "64"}):
        confined.load(BOX, "scene.xml", size, 0)
        assert process.cwd() == str(BOX)
        film, _ = confined.render((Pass(4, 0), Pass(1, 1)))
        np.testing.assert_array_equal(film[..., 3], 5)
    # Every thread that made the image is under the filter, and every limit holds
    if sys.platform == "linux":
        tasks = Path(f"/proc/{confined.pid}/task")
        threads, nice = list[str](), set[int]()
        for task in tasks.iterdir():
            with suppress(FileNotFoundError, ProcessLookupError):  # it has just ended
                threads.append((task / "status").read_text())
                nice.add(os.getpriority(os.PRIO_PROCESS, int(task.name)))
        assert len(threads) > 2
        # All give way to everything else, Mitsuba's threads too
        assert nice == {min(os.getpriority(os.PRIO_PROCESS, 0) + 10, 19)}
        assert all("Seccomp:\t2\n" in text and "NoNewPrivs:\t1\n" in text for text in threads)
        expected = {
            psutil.RLIMIT_AS: 8 << 30,
            psutil.RLIMIT_CORE: 0,
            psutil.RLIMIT_NOFILE: ChildLimits.open_files,
            psutil.RLIMIT_FSIZE: ChildLimits.file_bytes,
        }
        assert {kind: process.rlimit(kind) for kind in expected} == {
            kind: (most, most) for kind, most in expected.items()
        }


def test_the_largest_films_that_a_bundle_may_have_fit_the_largest_file() -> None:
    film_bytes = 16 * BundleLimits().max_pixels
    # The first pass, the sum, and those of 16 inputs
    assert ChildLimits.file_bytes == 18 * film_bytes


def test_the_oldest_compiled_kernels_make_room(
    child: Start, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(child_start, "_KERNELS", 2)
    kernels = tmp_path / "home" / ".drjit"
    kernels.mkdir(parents=True)
    for age in range(5):
        (kernels / f"{age}.bin").touch()
        os.utime(kernels / f"{age}.bin", (1000 - age, 1000 - age))
    child()
    assert {path.name for path in kernels.glob("*.bin")} == {"0.bin", "1.bin"}


@of_root
def test_the_kernel_shows_no_secret_of_a_child(
    child: Start, monkeypatch: pytest.MonkeyPatch
) -> None:
    secrets = {
        "PLATEAU_REDIS_URL": "redis://:swordfish@host",
        "AWS_SECRET_ACCESS_KEY": "swordfish",
        "AWS_CONTAINER_CREDENTIALS_FULL_URI": "http://swordfish",
        "HTTPS_PROXY": "http://user:swordfish@proxy",
        "KUBERNETES_SERVICE_HOST": "swordfish",
    }
    for name, value in secrets.items():
        monkeypatch.setenv(name, value)
    started = child()
    environment = Path(f"/proc/{started.pid}/environ").read_bytes()
    descriptors = [
        (link.readlink() if link.is_symlink() else link).as_posix()
        for link in Path(f"/proc/{started.pid}/fd").iterdir()
    ]
    assert b"HOME=" in environment
    assert b"swordfish" not in environment
    assert not [name for name in secrets if name.encode() in environment]
    # Nor does it hold a connection of the worker's: one socket, to its supervisor
    assert len([target for target in descriptors if target.startswith("socket:")]) == 1


def test_a_film_that_is_too_large_for_a_file_ends_the_child_in_words(child: Start) -> None:
    tight = child(file_bytes=10_000)
    tight.load(BOX, "scene.xml", SMALL, 0)
    tight.render((Pass(1, 0),))
    with pytest.raises(ChildDied, match=r"failed while loading.*OSError: .*File too large"):
        tight.load(BOX, "scene.xml", {"width": "64", "height": "64"}, 0)


def test_too_many_open_files_end_a_load_in_words(child: Start, tmp_path: Path) -> None:
    # Given a child that has all the files open that it may have: as if a scene had opened them
    full = child()
    psutil.Process(full.pid).rlimit(psutil.RLIMIT_NOFILE, (3, 3))
    with pytest.raises((SceneError, ChildDied), match=r"scene.xml|open"):
        full.load(BOX, "scene.xml", SMALL, 0)


def test_a_start_that_fails_is_told_in_words(child: Start) -> None:
    with pytest.raises(ChildDied, match=r"(?s)while starting.*Too many open files"):
        child(open_files=3)


def _sphere(*inside: str) -> str:
    return f'<shape type="sphere">{"".join(inside)}</shape>'


def _moved(by: str) -> str:
    return _sphere(f'<transform name="to_world">{by}</transform>')


def _ply(header: str, body: bytes = b"") -> bytes:
    return f"ply\n{header}\nend_header\n".encode() + body


_XYZ = "\nproperty float x\nproperty float y\nproperty float z"
_FACES = "\nproperty list uchar int vertex_indices"
_MESH = '<shape type="ply"><string name="filename" value="a.ply"/></shape>'

#: What the check of a bundle lets through, since only a renderer can tell: body, and a mesh.
HOSTILE = {
    "a transform that is no number": (_moved(f'<matrix value="{" ".join(["nan"] * 16)}"/>'), b""),
    "a transform without an inverse": (_moved(f'<matrix value="{" ".join(["0"] * 16)}"/>'), b""),
    "an infinite scale": (_moved('<scale value="inf"/>'), b""),
    "a scale past float32": (_moved('<scale value="1e300"/>'), b""),
    "a number past float64": (_sphere('<float name="radius" value="1e999"/>'), b""),
    "an integer past 64 bits": (_sphere(f'<integer name="x" value="{"9" * 40}"/>'), b""),
    "an object inside itself": (_sphere('<ref id="me"/>').replace(">", ' id="me">', 1), b""),
    "a mesh of nothing": (_MESH, b""),
    "a mesh that ends early": (
        _MESH,
        _ply(f"format binary_little_endian 1.0\nelement vertex 9{_XYZ}", bytes(5)),
    ),
    "a mesh of 10^12 vertices": (
        _MESH,
        _ply(f"format binary_little_endian 1.0\nelement vertex 1000000000000{_XYZ}"),
    ),
    "faces of vertices that are not there": (
        _MESH,
        _ply(
            f"format ascii 1.0\nelement vertex 1{_XYZ}\nelement face 1{_FACES}",
            b"0 0 0\n3 7 800000 -9\n",
        ),
    ),
}


def test_whatever_a_scene_says_a_child_renders_it_or_tells_why_not(
    child: Start, tmp_path: Path
) -> None:
    tried = child(memory_bytes=4 << 30)
    for number, (what, (body, mesh)) in enumerate(HOSTILE.items()):
        folder = tmp_path / str(number)
        folder.mkdir()
        (folder / "a.ply").write_bytes(mesh)
        (folder / "scene.xml").write_text(
            '<scene version="3.0.0"><integrator type="path"/><sensor type="perspective">'
            '<film type="hdrfilm"><integer name="width" value="8"/>'
            '<integer name="height" value="8"/></film></sensor>'
            f'<emitter type="constant"/>{body}</scene>'
        )
        words = ""
        try:
            tried.load(folder, "scene.xml", {}, 0)
            film, _ = tried.render((Pass(1, 0),))
            assert film.shape == (8, 8, 4)
        except (SceneError, ChildDied) as error:
            words = str(error)
        assert not words or (len(words) > 20 and str(tmp_path) not in words), what
        # And whoever comes next is served, by this child or by another
        tried = tried if tried.alive else child(memory_bytes=4 << 30)
        tried.load(BOX, "scene.xml", SMALL, 0)
        tried.render((Pass(1, 0),))


def test_a_machine_without_a_filter_is_told_of(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(platform, "machine", lambda: "riscv64")
    with pytest.raises(OSError, match="no filter for linux on riscv64"):
        refuse_calls()


@pytest.mark.parametrize(("on_gpu", "limited"), [(False, "RLIMIT_AS"), (True, "RLIMIT_DATA")])
def test_on_a_gpu_the_data_are_limited_and_not_the_addresses(on_gpu: bool, limited: str) -> None:
    # CUDA reserves 300 GB of addresses, and starts with no limit below that
    program = dedent(f"""
        import resource
        from plateau.worker.confinement.confine import limit_resources
        limit_resources(2**32, 64, 2**20, on_gpu={on_gpu})
        names = ("RLIMIT_AS", "RLIMIT_DATA")
        print(*(one for one in names if resource.getrlimit(getattr(resource, one))[0] == 2**32))
    """)
    done = subprocess.run(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, text=True, check=True
    )
    assert done.stdout.split() == [limited]
