"""Steps and caps of any size become whole numbers of slices."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from plateau.farm.model.spec import JobSpec
from plateau.farm.model.spec.parts import LAG
from plateau.farm.model.spec.whole_slices import changes, fitted
from plateau.rules import MOST_SPP

FRAME, ZONES, AUTO = {"name": "frame"}, {"name": "zones"}, {"name": "auto"}
OIDN = {"name": "oidn"}


@pytest.mark.parametrize(
    ("asked", "expected"),
    [
        # What fits stays
        ({}, (100, 25, 10_000)),
        ({"step": 50, "slice_spp": 50, "max_spp": 50}, (50, 50, 50)),
        # The slices give way first
        ({"max_spp": 10}, (100, 10, 10)),
        ({"max_spp": 1}, (100, 1, 1)),
        ({"max_spp": 110}, (100, 10, 110)),
        ({"step": 30}, (30, 10, 10_000)),
        ({"step": 90}, (90, 10, 10_000)),
        # Then the step
        ({"max_spp": 1_001}, (104, 13, 1_001)),
        ({"step": 97}, (100, 25, 10_000)),
        # In the end the cap, which falls
        ({"max_spp": 997}, (100, 25, 975)),
        ({"max_spp": 997, "min_spp": 990}, (100, 25, 975)),
        ({"max_spp": 33}, (99, 33, 33)),
        ({"max_spp": 97}, (97, 97, 97)),
        # Slices hold the passes that are inputs
        ({"max_spp": 110, "inputs": (1, 16)}, (100, 25, 100)),
        ({"slice_spp": 64, "inputs": (1, 64)}, (128, 64, 9_984)),
        ({"step": 1024, "slice_spp": 256, "max_spp": 1000, "inputs": (256,)}, (1024, 256, 1024)),
        # By zones, steps have a multiple of four slices, and any cap above two steps will do
        ({"max_spp": 997, "allocation": ZONES}, (100, 25, 997)),
        ({"step": 50, "allocation": ZONES}, (48, 12, 10_000)),
        ({"max_spp": 201, "allocation": ZONES}, (100, 25, 201)),
        # What may become either fits both
        ({"step": 50, "max_spp": 997, "allocation": AUTO}, (48, 12, 996)),
        # A cap within them is one of whole films
        ({"max_spp": 1, "allocation": ZONES}, (100, 1, 1)),
        ({"max_spp": 2, "allocation": ZONES}, (100, 1, 2)),
        ({"max_spp": 10, "allocation": ZONES}, (100, 5, 10)),
        ({"max_spp": 33, "allocation": ZONES}, (132, 33, 33)),
        ({"max_spp": 97, "allocation": ZONES}, (388, 97, 97)),
        ({"max_spp": 10, "allocation": ZONES, "denoise": OIDN}, (100, 5, 10)),
        ({"max_spp": 97, "allocation": ZONES, "denoise": OIDN}, (96, 24, 96)),
        # Where the image is denoised, steps and the cap have a multiple of two
        ({"max_spp": 10, "denoise": OIDN}, (100, 5, 10)),
        ({"max_spp": 1, "denoise": OIDN}, (100, 1, 2)),
        ({"max_spp": 2, "denoise": OIDN}, (100, 1, 2)),
        ({"max_spp": 33, "denoise": OIDN}, (96, 16, 32)),
        ({"max_spp": 50, "denoise": OIDN}, (100, 25, 50)),
        # The cap falls by a twentieth at most, or the slices give way
        ({"max_spp": 97, "denoise": OIDN}, (96, 24, 96)),
        ({"max_spp": 997, "denoise": OIDN}, (100, 25, 950)),
    ],
)
def test_the_least_that_is_needed_changes(
    asked: dict[str, Any], expected: tuple[int, int, int]
) -> None:
    fit = fitted(JobSpec(**{"allocation": FRAME, **asked}))
    assert (fit.step, fit.slice_spp, fit.max_spp) == expected


def test_slices_that_exist_keep_their_size() -> None:
    fit = fitted(JobSpec(max_spp=110, step=60, allocation=FRAME), keep_slices=True)
    assert (fit.step, fit.slice_spp, fit.max_spp) == (50, 25, 125)


def test_changes_are_told() -> None:
    asked = JobSpec(max_spp=10, slice_spp=20, allocation=FRAME)
    assert changes(asked, fitted(asked)) == (
        "slice_spp is 10 in place of 20: steps and the cap are whole numbers of slices",
    )
    assert changes(JobSpec(), fitted(JobSpec())) == ()


@pytest.mark.parametrize("cap", [10, 64, 256, 1000])
def test_what_nobody_asked_for_changes_without_a_word(cap: int) -> None:
    assert changes(JobSpec(max_spp=cap), fitted(JobSpec(max_spp=cap))) == ()


def test_another_cap_is_always_told() -> None:
    (note,) = changes(JobSpec(max_spp=997), fitted(JobSpec(max_spp=997)))
    assert note.startswith("max_spp is 975 in place of 997: ")


@given(
    st.integers(1, MOST_SPP),
    st.integers(1, 4096),
    st.integers(1, MOST_SPP),
    st.sampled_from(
        [
            {"allocation": one, **more}
            for one in (FRAME, ZONES, AUTO)
            for more in ({}, {"denoise": OIDN})
        ]
    ),
    st.booleans(),
)
def test_every_spec_fits(step: int, size: int, cap: int, more: dict[str, Any], keep: bool) -> None:
    asked = JobSpec(step=step, slice_spp=size, max_spp=cap, **more)
    fit = fitted(asked, keep_slices=keep)
    assert fitted(fit) == fit
    # And is one that may be submitted
    assert JobSpec.model_validate(fit.model_dump()) == fit
    least = 2 if fit.is_denoised else 1
    assert not fit.step % (fit.slice_spp * (4 if fit.by_zones else least))
    is_free = fit.allocation.name == "zones" and fit.max_spp > LAG * fit.step
    unit = 1 if is_free else fit.slice_spp * least
    assert not fit.max_spp % unit
    # No more is rendered than was asked for, and little less; slices that exist are filled up
    if keep:
        assert fit.slice_spp == size
        assert cap <= fit.max_spp < cap + unit or fit.max_spp > MOST_SPP - unit
    else:
        assert cap - unit < fit.max_spp <= max(cap, least)
        assert fit.max_spp >= 0.95 * cap or cap < 20 * least * fit.slice_spp
