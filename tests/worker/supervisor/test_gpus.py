"""Which GPUs a render child may use, and the driver by which it reaches them."""

from pathlib import Path

import pytest

from plateau.worker.supervisor import gpus


@pytest.fixture
def libraries(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, str]]:
    """What the dynamic linker knows; empty at first."""
    known: list[tuple[str, str]] = []
    monkeypatch.setattr(gpus, "system_libraries", lambda: known)
    monkeypatch.delenv("DRJIT_LIBCUDA_PATH", raising=False)
    return known


def test_a_choice_of_gpus_is_handed_down(
    libraries: list[tuple[str, str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "1,3")
    monkeypatch.setenv("PLATEAU_KEY", "swordfish")
    assert gpus.environment() == {"CUDA_VISIBLE_DEVICES": "1,3"}


def test_a_driver_where_drjit_does_not_look_is_named(libraries: list[tuple[str, str]]) -> None:
    libraries.append(("libcuda.so.1", "/usr/local/nvidia/lib64/libcuda.so.1"))
    assert gpus.cuda_driver() == Path("/usr/local/nvidia/lib64/libcuda.so.1")
    assert gpus.environment()["DRJIT_LIBCUDA_PATH"] == "/usr/local/nvidia/lib64/libcuda.so.1"


def test_a_driver_in_its_usual_place_is_left_to_drjit(libraries: list[tuple[str, str]]) -> None:
    libraries.append(("libcuda.so.1", "/usr/lib/x86_64-linux-gnu/libcuda.so.1"))
    assert "DRJIT_LIBCUDA_PATH" not in gpus.environment()


def test_a_driver_that_a_person_names_comes_first(
    libraries: list[tuple[str, str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "libcuda.so").touch()
    libraries.append(("libcuda.so.1", "/usr/local/nvidia/lib64/libcuda.so.1"))
    monkeypatch.setenv("DRJIT_LIBCUDA_PATH", str(tmp_path / "libcuda.so"))
    assert gpus.cuda_driver() == tmp_path / "libcuda.so"


def test_without_a_driver_there_is_none(libraries: list[tuple[str, str]]) -> None:
    libraries.append(("libcudart.so.12", "/usr/lib/libcudart.so.12"))
    assert gpus.cuda_driver() is None
