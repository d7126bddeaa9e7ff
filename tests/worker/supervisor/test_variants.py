"""The choice of a variant: which candidates, in which order, and what is remembered of them."""

import json
import os
import shutil
from pathlib import Path

import pytest

from plateau.worker.supervisor import gpus, variants
from plateau.worker.supervisor.llvm_libraries import in_order_of_trial, version
from plateau.worker.supervisor.variants import CUDA, LLVM, SCALAR, VariantChoice, choose, probe
from tests.support.variants import known_probe, library_for


def _libraries(folder: Path, *names: str) -> list[Path]:
    files = [folder / name for name in names]
    for file in files:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(b"not a library")
    return files


class TestLibraries:
    @pytest.mark.parametrize(
        ("name", "expected"),
        [
            ("libLLVM.so.19.1", (19, 1)),
            ("libLLVM-15.so.1", (15, 0)),
            ("libLLVM-14.0.6.so", (14, 0)),
            ("llvm-16/lib/libLLVM.so", (16, 0)),
            ("opt/llvm@18/lib/libLLVM.dylib", (18, 0)),
            ("Cellar/llvm/20.1/lib/libLLVM.dylib", (20, 1)),
            ("libLLVM.so", (0, 0)),
        ],
    )
    def test_the_version_is_in_the_path(self, tmp_path, name, expected):
        (library,) = _libraries(tmp_path, name)
        assert version(library) == expected

    def test_the_newest_is_tried_first_and_a_version_is_a_number(self, tmp_path):
        old, newest, new = _libraries(
            tmp_path, "libLLVM-9.so.1", "libLLVM.so.19.1", "libLLVM-15.so"
        )
        assert in_order_of_trial(None, [old, newest, new]) == (newest, new, old)

    def test_the_one_that_the_environment_names_goes_before(self, tmp_path):
        old, newest = _libraries(tmp_path, "libLLVM-15.so.1", "libLLVM.so.19.1")
        assert in_order_of_trial(str(old), [newest, old]) == (old, newest)

    def test_one_that_is_not_there_is_left_out(self, tmp_path):
        (library,) = _libraries(tmp_path, "libLLVM.so.19.1")
        assert in_order_of_trial(str(tmp_path / "gone.so"), [library]) == (library,)

    def test_links_to_one_file_are_one_library(self, tmp_path):
        real, other = _libraries(tmp_path, "libLLVM.so.19.1", "libLLVM-15.so.1")
        links = [tmp_path / "libLLVM-19.so", tmp_path / "libLLVM-19.so.1"]
        for link in links:
            link.symlink_to(real)
        order = in_order_of_trial(str(links[0]), [*links, real, other])
        assert order == (real, other)


@pytest.fixture
def dying_children(tmp_path, monkeypatch):
    """Every Python process started from here on aborts, as an LLVM that does not fit does."""
    folder = tmp_path / "dying"
    folder.mkdir()
    (folder / "sitecustomize.py").write_text(
        "import os, sys\nprint('LLVM ERROR: Cannot select', file=sys.stderr)\n"
        "print('In function: drjit', file=sys.stderr, flush=True)\nos.abort()\n",
        encoding="utf-8",
    )
    return lambda: monkeypatch.setenv("PYTHONPATH", str(folder))


@pytest.fixture
def signalled(tmp_path, monkeypatch):
    """Every Python process started from here on signals itself, at a start or at an import."""
    folder = tmp_path / "signalled"
    folder.mkdir()

    def arrange(name: str, *, at: str) -> None:
        (folder / "sitecustomize.py").write_text(
            "import os, signal, sys\n"
            f"def hit(): os.kill(os.getpid(), signal.{name})\n"
            "def hook(event, about):\n"
            f"    if event == 'import' and about[0] == {at!r}: hit()\n"
            f"hit() if {at!r} == 'site' else sys.addaudithook(hook)\n",
            encoding="utf-8",
        )
        monkeypatch.setenv("PYTHONPATH", str(folder), prepend=os.pathsep)

    return arrange


class TestProbe:
    def test_what_is_no_library_is_refused_in_words(self, tmp_path):
        (library,) = _libraries(tmp_path, "libLLVM.so.19.1")
        found = probe(LLVM, str(library))
        assert not found.ok
        assert "the LLVM backend is inactive" in found.detail

    def test_an_abort_costs_the_child_and_is_told(self, dying_children):
        dying_children()
        found = probe(SCALAR, None)
        assert not found.ok
        assert found.detail == "was ended by SIGABRT, saying LLVM ERROR: Cannot select"

    def test_a_library_that_is_missing_is_named(self, tmp_path, monkeypatch):
        # Given a Dr.Jit that hides which library it lacks behind another error, as the real one
        (tmp_path / "drjit.py").write_text(
            "import ctypes\ntry: ctypes.CDLL('libfancy.so.3')\nexcept OSError: _drjit_ext.__file__",
            encoding="utf-8",
        )
        monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)
        assert probe(SCALAR, None).detail == (
            "exited with 1, saying OSError: libfancy.so.3: cannot open shared object file: No such "
            "file or directory"
        )

    # Python's own KeyboardInterrupt makes an exit code of the one, and an abort of the other.
    @pytest.mark.parametrize("at", ["site", "mitsuba.mitsuba_ext"])
    def test_ctrl_c_ends_it_as_a_signal_does_whatever_it_is_doing(self, signalled, at):
        signalled("SIGINT", at=at)
        found = probe(SCALAR, None)
        assert (found.ok, found.detail) == (False, "was ended by SIGINT, saying nothing")

    def test_a_hang_is_ended(self):
        found = probe(SCALAR, None, timeout_s=0.01)
        assert not found.ok
        assert found.detail == "gave no image within 0.01 s"


@pytest.fixture
def no_driver(monkeypatch):
    monkeypatch.setattr(gpus, "cuda_driver", lambda: None)
    monkeypatch.setattr(variants, "program_of", lambda _: None)


@pytest.fixture
def broken_library(tmp_path, monkeypatch, no_driver):
    (library,) = _libraries(tmp_path, "libLLVM.so.19.1")
    monkeypatch.setattr(variants, "llvm_libraries", lambda: (library,))
    return library


@pytest.fixture
def tried_before(monkeypatch):
    """What works was tried before, and is not tried again."""
    monkeypatch.setattr(variants, "probe", known_probe)


@pytest.fixture(scope="module")
def made_once(tmp_path_factory) -> tuple[VariantChoice, Path, Path]:
    """A choice where there is but a library that fails, that library, and what is remembered."""
    folder = tmp_path_factory.mktemp("choice")
    (library,) = _libraries(folder, "libLLVM.so.19.1")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(variants, "llvm_libraries", lambda: (library,))
        return choose(folder / "cache"), library, folder / "cache" / "variant.json"


@pytest.fixture
def first(tmp_path, monkeypatch, no_driver, made_once) -> VariantChoice:
    """The same choice, remembered in a cache of the test's own."""
    choice, library, memory = made_once
    monkeypatch.setattr(variants, "llvm_libraries", lambda: (library,))
    (tmp_path / "cache").mkdir()
    shutil.copy(memory, tmp_path / "cache")
    return choice


class TestChoice:
    def test_without_libraries_it_is_scalar_and_says_so(
        self, tmp_path, monkeypatch, no_driver, tried_before
    ):
        monkeypatch.setattr(variants, "llvm_libraries", lambda: ())
        choice = choose(tmp_path)
        assert choice.variant == SCALAR
        spectral = ("scalar_spectral", "scalar_spectral_polarized")
        assert choice.variants == (SCALAR, *spectral, "analytic:numpy")
        assert choice.why == "scalar_rgb: neither a CUDA driver nor an LLVM library was found"

    def test_a_library_that_fails_is_passed_over_and_named(self, made_once):
        choice, library, _ = made_once
        assert (choice.variant, choice.llvm_library) == (SCALAR, None)
        assert [one.ok for one in choice.tried] == [False, True]
        assert choice.why.startswith("scalar_rgb renders here (llvm_ad_rgb with ")
        assert str(library) in choice.why

    @pytest.mark.llvm
    def test_the_first_that_works_is_taken_and_the_rest_left(
        self, tmp_path, monkeypatch, broken_library, tried_before
    ):
        good = library_for(LLVM)
        monkeypatch.setattr(
            variants, "llvm_libraries", lambda: (broken_library, Path(good), Path("/never/tried"))
        )
        monkeypatch.setattr(variants, "_identity", lambda _: {})
        choice = choose(tmp_path)
        assert (choice.variant, choice.llvm_library) == (LLVM, good)
        assert choice.variants[:2] == (LLVM, SCALAR)
        assert {"analytic:numpy", "llvm_ad_spectral", "llvm_ad_mono", "scalar_spectral"} < set(
            choice.variants
        )
        assert "cuda_ad_spectral" not in choice.variants
        assert [one.library for one in choice.tried] == [str(broken_library), good]

    def test_every_candidate_is_tried_on_demand(self, tmp_path, first):
        found = choose(tmp_path / "cache", every=True).tried
        assert [(one.variant, one.ok) for one in found][1:] == [(SCALAR, True)]

    @pytest.mark.parametrize("every", [True, False])
    def test_where_nothing_renders_it_says_so(
        self, tmp_path, broken_library, dying_children, every
    ):
        dying_children()
        choice = choose(tmp_path, every=every)
        assert choice.variant == SCALAR
        assert choice.why.startswith("nothing renders here: ")
        assert [one.ok for one in choice.tried] == [False, False]


class TestMemory:
    @pytest.fixture
    def first(self, first, dying_children) -> VariantChoice:
        """A choice that is remembered; whoever tries again from here on gets another."""
        dying_children()
        return first

    @staticmethod
    def _tried_again(choice: VariantChoice) -> bool:
        return "SIGABRT" in choice.tried[0].detail

    def test_a_second_start_tries_nothing(self, tmp_path, first):
        assert choose(tmp_path / "cache") == first

    def test_another_library_is_tried(self, tmp_path, first, made_once):
        _, library, _ = made_once
        was = library.stat().st_mtime_ns
        os.utime(library, (1, 1))
        found = choose(tmp_path / "cache")
        os.utime(library, ns=(was, was))  # for the other tests
        assert self._tried_again(found)

    @pytest.mark.parametrize(
        "content", ["", "{", "[]", "null", '{"identity": 1}', '{"identity": {}, "known": 3}']
    )
    def test_a_corrupt_memory_is_no_memory(self, tmp_path, first, content):
        (tmp_path / "cache/variant.json").write_text(content, encoding="utf-8")
        assert self._tried_again(choose(tmp_path / "cache"))

    def test_a_memory_of_the_wrong_shape_is_no_memory(self, tmp_path, first):
        file = tmp_path / "cache" / "variant.json"
        content = json.loads(file.read_text(encoding="utf-8"))
        content["known"][0].update(colour="red")
        file.write_text(json.dumps(content), encoding="utf-8")
        assert self._tried_again(choose(tmp_path / "cache"))

    def test_a_folder_that_cannot_be_written_is_no_obstacle(
        self, tmp_path, broken_library, tried_before
    ):
        (tmp_path / "file").write_text("in the way", encoding="utf-8")
        assert choose(tmp_path / "file").variant == SCALAR

    def test_a_failure_of_the_moment_is_not_remembered(self, tmp_path, monkeypatch, tried_before):
        # A GPU that is taken today may be free tomorrow.
        monkeypatch.setattr(gpus, "cuda_driver", lambda: Path("/libcuda"))
        monkeypatch.setattr(variants, "llvm_libraries", lambda: ())
        monkeypatch.setenv("DRJIT_LIBCUDA_PATH", "/nowhere/libcuda.so")
        choice = choose(tmp_path)
        assert [one.variant for one in choice.tried] == [CUDA, SCALAR]
        assert not (tmp_path / "variant.json").exists()

    @pytest.mark.parametrize("name", ["SIGTERM", "SIGINT", "SIGHUP", "SIGKILL"])
    def test_a_signal_from_outside_says_nothing_of_the_library(
        self, tmp_path, broken_library, signalled, name
    ):
        # As when Slurm ends a worker that is about to find out what works here, or the kernel is
        # short of memory.
        signalled(name, at="site")
        choice = choose(tmp_path / "cache")
        assert choice.variant == SCALAR
        assert choice.tried[0].detail.startswith(f"was ended by {name}, ")
        assert not (tmp_path / "cache/variant.json").exists()

    @pytest.mark.parametrize("name", ["SIGABRT", "SIGSEGV", "SIGILL", "SIGBUS", "SIGFPE"])
    def test_a_crash_is_remembered(self, tmp_path, broken_library, signalled, name):
        signalled(name, at="site")
        choice = choose(tmp_path / "cache")
        assert choice.tried[0].detail.startswith(f"was ended by {name}, ")
        signalled("SIGKILL", at="site")
        assert choose(tmp_path / "cache") == choice
