"""The variants of Blender's Cycles: the farm's facts, and which a worker tries and offers."""

import sys
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType

import pytest
from pydantic import ValidationError

from plateau.farm.model import renderers
from plateau.farm.model.renderers import MITSUBA, renderer_of, variant_for, variant_named
from plateau.farm.model.spec import JobSpec
from plateau.worker.supervisor import gpus, variants
from plateau.worker.supervisor.variants import SCALAR, Probe, VariantChoice, choose
from tests.support.path_programs import put_on_path

GPUS = ("cycles:optix", "cycles:cuda", "cycles:hip", "cycles:oneapi")


@pytest.mark.parametrize("name", GPUS)
def test_a_device_of_cycles_draws_the_sequences_that_its_processor_draws(name):
    known, cpu = variant_named(name), variant_named("cycles:cpu")
    assert (renderer_of(name).package, known.seeds) == ("bpy", cpu.seeds)
    # But it is offered only where it was tried
    assert (known.on_gpu, known.works_everywhere) == (True, False)
    assert (cpu.on_gpu, cpu.works_everywhere) == (False, True)
    # And no other variant works because it does
    assert [one for one in renderers.variants() if variant_named(one).backend == known.backend] == [
        name
    ]


def test_a_gpu_renders_a_blender_file_if_it_is_asked_for_by_name():
    assert variant_for("auto", "cycles") == "cycles:cpu"
    assert [variant_for(name, "cycles") for name in GPUS] == list(GPUS)
    assert JobSpec(variant="cycles:optix").variant == "cycles:optix"
    with pytest.raises(ValueError, match=r"renderer mitsuba, which has no variant cycles:cuda"):
        variant_for("cycles:cuda", MITSUBA)
    with pytest.raises(ValidationError, match="cycles:oneapi"):
        JobSpec.model_validate({"variant": "cycles:metal"})


class TestDevicesOfCycles:
    @pytest.fixture(autouse=True)
    def _scalar_alone(self, monkeypatch):
        """Beside Blender, as Python would find it."""
        there = ModuleType("bpy")
        there.__spec__ = ModuleSpec("bpy", None)
        monkeypatch.setitem(sys.modules, "bpy", there)
        monkeypatch.setattr(variants.identity, "of", lambda _: {})
        monkeypatch.setattr(gpus, "cuda_driver", lambda: None)
        monkeypatch.setattr(variants, "llvm_libraries", lambda: ())

    def test_without_a_driver_none_is_tried(self, tmp_path, monkeypatch):
        monkeypatch.setattr(variants, "system_libraries", lambda: [("libc.so.6", Path("/libc"))])
        choice = choose(tmp_path)
        assert [one.variant for one in choice.tried] == [SCALAR]
        assert choice.like("cycles:cuda") == ("cycles:cpu",)

    def test_those_of_a_driver_are_tried_and_none_is_offered_that_fails(
        self, tmp_path, monkeypatch
    ):
        found = [("libcuda.so.1", Path("/libcuda")), ("libze_loader.so.1", Path("/libze"))]
        monkeypatch.setattr(variants, "system_libraries", lambda: found)
        # Given a Blender that cannot be imported in truth
        choice = choose(tmp_path)
        assert [(one.variant, one.ok) for one in choice.tried] == [
            (SCALAR, True),
            *((f"cycles:{device}", False) for device in ("optix", "cuda", "oneapi")),
        ]
        assert (choice.variant, choice.like("cycles:cuda")) == (SCALAR, ("cycles:cpu",))
        # And they are tried again, for a GPU may have been in use
        assert not (tmp_path / "variant.json").exists()

    def test_all_that_work_are_offered_and_mitsubas_choice_stays(self, tmp_path, monkeypatch):
        found = [("libcuda.so.1", Path("/libcuda"))]
        monkeypatch.setattr(variants, "system_libraries", lambda: found)
        monkeypatch.setattr(
            variants, "probe", lambda one, library: Probe(one, library, ok=True, detail="")
        )
        choice = choose(tmp_path)
        assert choice.variant == SCALAR
        assert choice.like("cycles:cpu") == ("cycles:optix", "cycles:cuda", "cycles:cpu")
        # And what worked is remembered
        monkeypatch.delattr(variants, "probe")
        assert choose(tmp_path) == choice


def test_variants_of_a_package_that_is_not_installed_are_not_offered(monkeypatch):
    works = VariantChoice(SCALAR, None, "", (Probe(SCALAR, None, ok=True, detail=""),))
    monkeypatch.setitem(sys.modules, "bpy", None)  # as Python marks what cannot be imported
    assert "cycles:cpu" not in works.variants
    there = ModuleType("bpy")
    there.__spec__ = ModuleSpec("bpy", None)
    monkeypatch.setitem(sys.modules, "bpy", there)
    assert "cycles:cpu" in works.variants


def test_a_blender_program_that_renders_nothing_is_tried_and_not_offered(tmp_path, monkeypatch):
    # Given a program that is none: a script on the PATH
    put_on_path(tmp_path / "blender", "exit 0", monkeypatch)
    monkeypatch.setattr(gpus, "cuda_driver", lambda: None)
    monkeypatch.setattr(variants, "llvm_libraries", lambda: ())
    choice = choose(tmp_path / "cache")
    assert [(one.variant, one.ok) for one in choice.tried] == [
        (SCALAR, True),
        ("cycles:cpu", False),
    ]
    assert "it has to be the program itself" in choice.tried[1].detail
    assert (choice.variant, choice.like("cycles:cpu")) == (SCALAR, ())
