"""What a shell writes as text is taken by every door, and refused in the same words."""

import json
from typing import Any

import pytest

from plateau.client import InvalidSpec
from plateau.client.submission import spec_of
from plateau.farm.model.spec import PLACES, BatchSpec, JobSpec
from plateau.service.api.problems.problem import Problem
from plateau.service.api.submission.submitted_spec import submitted_spec

SAME: list[tuple[dict[str, Any], dict[str, Any]]] = [
    ({"rule": "fixed"}, {"rule": {"name": "fixed"}}),
    ({"rule": "jod:target=9,min_spp=3"}, {"rule": {"name": "jod", "target": 9, "min_spp": 3}}),
    ({"watch": ["reverse:window=7"]}, {"watch": [{"name": "reverse", "window": 7}]}),
    ({"watch": "reverse"}, {"watch": [{"name": "reverse"}]}),
    ({"allocation": "zones:size=32"}, {"allocation": {"name": "zones", "size": 32}}),
    ({"denoise": "oidn"}, {"denoise": {"name": "oidn"}}),
    ({"denoise": "oidn:guides=false"}, {"denoise": {"name": "oidn", "guides": False}}),
    ({"view": "phone"}, {"view": dict(PLACES["phone"])}),
    ({"view": {"background": "1,0,0.5"}}, {"view": {"background": [1, 0, 0.5]}}),
    ({"parameters": ["a=1", "b=c=d"]}, {"parameters": {"a": "1", "b": "c=d"}}),
    ({"parameters": "a=1"}, {"parameters": {"a": "1"}}),
    ({"aovs": "albedo"}, {"aovs": ["albedo"]}),
]

WRONG: list[tuple[dict[str, Any], str]] = [
    ({"rule": "hunch"}, "spec.rule: must have the name fixed, "),
    ({"rule": "jod:target"}, "spec.rule: takes NAME or NAME:PARAMETER=VALUE,…"),
    ({"rule": "jod:target=99"}, "spec.rule.target: must be at most 9.99"),
    ({"watch": ["fixed", "jod:aim=9"]}, "spec.watch.1.aim: there is no such field"),
    ({"view": "office"}, "spec.view: must be screen, desk, phone, cinema, paper, or an object"),
    ({"view": {"background": "red"}}, "spec.view.background: takes R,G,B"),
    ({"parameters": ["a"]}, "spec.parameters: takes NAME=VALUE"),
    ({"denoise": "optix"}, "spec.denoise: must have the name none or oidn"),
]


@pytest.mark.parametrize(("text", "whole"), SAME, ids=[str(text) for text, _ in SAME])
def test_a_text_is_what_it_stands_for(text: dict[str, Any], whole: dict[str, Any]) -> None:
    meant = JobSpec.model_validate(whole)
    assert spec_of(None, text) == meant
    assert submitted_spec(json.dumps(text)) == meant


@pytest.mark.parametrize(("text", "words"), WRONG, ids=[str(text) for text, _ in WRONG])
def test_a_wrong_one_is_refused_by_its_field(text: dict[str, Any], words: str) -> None:
    with pytest.raises(InvalidSpec) as here:
        spec_of(None, text)
    with pytest.raises(Problem) as there:
        submitted_spec(json.dumps(text))
    for refused in (str(here.value), str(there.value)):
        assert words in refused
        assert "pydantic" not in refused


def test_a_batch_takes_texts_and_the_schema_of_requests_names_them() -> None:
    spec = submitted_spec('{"parameters": [["a=1", "b=2"], {"a": 3}], "rule": "fixed:spp=4"}')
    assert isinstance(spec, BatchSpec)
    assert spec.parameters == ({"a": "1", "b": "2"}, {"a": 3})
    fields = JobSpec.model_json_schema()["properties"]
    for name in ("rule", "watch", "allocation", "denoise", "shot", "parameters", "aovs"):
        assert any(one.get("type") == "string" for one in fields[name]["anyOf"]), name


def test_what_was_given_is_told_where_it_was_given_and_no_secret() -> None:
    with pytest.raises(InvalidSpec, match=r"^spec\.max_spp: must be at least 1, not -3$") as one:
        spec_of(None, {"max_spp": -3})
    assert one.value.slug == "invalid-spec"
    assert one.value.problem["errors"] == [
        {"field": "spec.max_spp", "message": "must be at least 1, not -3"}
    ]
    for notice in (
        {"url": "https://host/path", "secret": "swordfish"},
        {"url": 7, "secret": "swordfish"},
        {"targets": ["the swordfish, no name"]},
    ):
        with pytest.raises(InvalidSpec) as other:
            spec_of(None, {"notice": notice})
        assert "swordfish" not in str(other.value)
