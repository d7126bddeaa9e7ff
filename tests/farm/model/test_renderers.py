"""The variants of Blender's Cycles by their names: the farm's facts, and who is refused."""

import pytest
from pydantic import ValidationError

from plateau.farm.model.renderers import CYCLES, MITSUBA, VARIANTS, variant_for, variant_named
from plateau.farm.model.spec import JobSpec

GPUS = ("cycles:optix", "cycles:cuda", "cycles:hip", "cycles:oneapi")


@pytest.mark.parametrize("name", GPUS)
def test_a_device_of_cycles_draws_the_sequences_that_its_processor_draws(name):
    known, cpu = variant_named(name), variant_named("cycles:cpu")
    assert (known.renderer, known.seeds, known.package) == (CYCLES, cpu.seeds, "bpy")
    # But it is offered only where it was tried
    assert (known.on_gpu, known.works_everywhere) == (True, False)
    assert (cpu.on_gpu, cpu.works_everywhere) == (False, True)
    # And no other variant works because it does
    assert [one for one in VARIANTS if variant_named(one).backend == known.backend] == [name]


def test_a_gpu_renders_a_blender_file_if_it_is_asked_for_by_name():
    assert variant_for("auto", CYCLES) == "cycles:cpu"
    assert [variant_for(name, CYCLES) for name in GPUS] == list(GPUS)
    assert JobSpec(variant="cycles:optix").variant == "cycles:optix"
    with pytest.raises(ValueError, match=r"renderer mitsuba, which has no variant cycles:cuda"):
        variant_for("cycles:cuda", MITSUBA)
    with pytest.raises(ValidationError, match="cycles:oneapi"):
        JobSpec.model_validate({"variant": "cycles:metal"})
