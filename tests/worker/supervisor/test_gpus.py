"""Which GPUs a render child may use, and the driver by which it reaches them."""

from pathlib import Path

import pytest

from plateau.worker.supervisor import gpus
from tests.support.path_programs import put_on_path


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


@pytest.mark.parametrize(
    ("says", "told"),
    [
        ("echo 0, 899, 143771", "GPU 0 has 899 of 143771 MiB free: end what holds"),
        ("echo 0, 140000, 143771; echo 1, 12, 143771", "GPU 1 has 12 of 143771 MiB free"),
        ("echo 0, 140000, 143771", None),
        ("echo No devices were found", None),
        ("exit 9", None),
    ],
)
def test_a_card_without_room_is_told_of(
    says: str, told: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    put_on_path(tmp_path / "nvidia-smi", says, monkeypatch)
    found = gpus.shortage()
    assert found is told is None or str(found).startswith(str(told))


def test_only_the_cards_that_are_named_are_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    put_on_path(tmp_path / "nvidia-smi", '[ "$4" = 1,3 ] && echo 3, 5, 80000', monkeypatch)
    assert gpus.shortage() is None
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "1,3")
    assert str(gpus.shortage()).startswith("GPU 3 has 5")


@pytest.mark.parametrize(
    ("says", "taken"),
    [
        ("echo GPU-a; echo GPU-b", ["GPU-a", "GPU-b", "GPU-a"]),
        ("echo GPU-a", [None, None, None]),
        ("echo No devices were found", [None, None, None]),
    ],
)
def test_the_workers_of_a_machine_take_its_gpus_in_turn(
    says: str, taken: list[str | None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    put_on_path(
        tmp_path / "nvidia-smi", f'[ "$1" = --query-gpu=uuid ] && {{ {says}; }}', monkeypatch
    )
    assert [gpus.of_worker(number).get("CUDA_VISIBLE_DEVICES") for number in range(3)] == taken
