"""A job's specification: sane defaults, and everything wrong is refused by name."""

import json
from typing import Any

import pytest
from pydantic import ValidationError

from plateau.farm.model.renderers import variants
from plateau.farm.model.spec import BatchSpec, JobSpec


def test_the_default_is_today_s_eye_on_a_desk_with_the_papers_rule_beside_it() -> None:
    spec = JobSpec()
    assert (spec.rule.name, spec.rule.target, spec.rule.min_spp) == ("jod", 9.5, 200)
    assert [rule.name for rule in spec.watch] == ["reverse"]
    assert spec.view == JobSpec(view="screen").view
    assert spec.view.words == "on a desk monitor at 200 %"
    assert (spec.step, spec.slice_spp, spec.max_spp) == (100, 25, 10_000)


@pytest.mark.parametrize("given", [{"rule": "reverse"}, {"denoise": "oidn"}, {"watch": ()}])
def test_the_papers_rule_is_not_watched(given: dict[str, Any]) -> None:
    assert JobSpec(**given).watch == ()


@pytest.mark.parametrize(
    ("given", "variant", "because"),
    [
        ({}, "llvm_ad_rgb", None),
        ({"denoise": "oidn"}, "analytic:numpy", None),
        ({}, "scalar_rgb", "variant"),
        ({}, "cuda_ad_rgb", "gpu"),
        ({"rule": "visible"}, "llvm_ad_rgb", "rule"),
        ({"keep_slices": True}, "llvm_ad_rgb", "keep_slices"),
        ({"shot": "24"}, "llvm_ad_rgb", "shot"),
    ],
)
def test_samples_go_to_zones_where_the_job_can_have_them(
    given: dict[str, Any], variant: str, because: str | None
) -> None:
    spec = JobSpec(**given)
    assert spec.frames_because(variant) == because
    assert spec.settled(variant).allocation.name == ("zones" if because is None else "frame")
    # As long as nobody knows the variant, it may be zones
    assert spec.by_zones is (because in {None, "variant", "gpu"})


@pytest.mark.parametrize(
    ("wrong", "words"),
    [({"seed": 4096}, "seed"), ({"watch": [{"name": "jod"}]}, "may be named once")],
)
def test_what_is_wrong_is_named(wrong: dict[str, Any], words: str) -> None:
    with pytest.raises(ValidationError, match=words):
        JobSpec.model_validate(wrong)


@pytest.mark.parametrize(
    ("absurd", "words"),
    [
        ({"step": 10**400}, "step"),
        ({"min_spp": 10**400}, r"(?m)^min_spp$"),  # by its own bound: not beside that of the cap
        ({"time_limit_s": 1e308}, "time_limit_s"),
        ({"time_limit_s": 5e-324}, "time_limit_s"),
        ({"rule": {"name": "fixed", "spp": 10**300}}, "spp"),
        ({"rule": {"name": "visible", "min_spp": 10**400}}, "min_spp"),
        ({"parameters": {"width": 10**400}}, "width"),
    ],
)
def test_what_would_fail_late_is_refused_in_a_job_and_in_a_batch(
    absurd: dict[str, Any], words: str
) -> None:
    with pytest.raises(ValidationError, match=words):
        JobSpec.model_validate(absurd)
    entry = absurd.get("parameters", {"frame": 1})
    with pytest.raises(ValidationError, match=words):
        BatchSpec.model_validate({**absurd, "parameters": [entry]})


def test_parameters_are_written_as_mitsuba_reads_them() -> None:
    spec = JobSpec(parameters={"width": 64, "hide": True, "scale": 0.5, "name": "a b"})
    assert spec.parameter_strings() == {
        "width": "64",
        "hide": "true",
        "scale": "0.5",
        "name": "a b",
    }


def test_a_spec_survives_its_json() -> None:
    spec = JobSpec(parameters={"width": 64, "light": 1.5}, watch=[{"name": "fixed", "spp": 50}])
    assert JobSpec.model_validate_json(spec.model_dump_json()) == spec


@pytest.mark.parametrize(
    "spec",
    [
        JobSpec(),
        JobSpec(step=50, max_spp=200, parameters={"width": 64}),
        JobSpec.model_validate(
            {"rule": {"name": "fixed", "spp": 100}, "watch": [{"name": "visible"}]}
        ),
    ],
)
def test_a_request_says_only_what_is_no_default(spec: JobSpec) -> None:
    said = json.loads(spec.as_request())
    default = JobSpec()
    assert all(getattr(spec, name) != getattr(default, name) for name in said)
    assert JobSpec.model_validate_json(spec.as_request()) == spec


@pytest.mark.parametrize("shown", variants())
def test_a_variant_is_taken_by_its_full_name_and_shown_by_its_stored_one(shown: str) -> None:
    known = variants()[shown]
    asked = JobSpec.model_validate_json(f'{{"variant": "{known.renderer}:{known.own_name}"}}')
    assert asked == JobSpec.model_validate({"variant": shown})
    assert json.loads(asked.model_dump_json())["variant"] == shown
