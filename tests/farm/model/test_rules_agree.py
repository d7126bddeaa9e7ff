"""The rules and views of a job are the metric's: the same parameters, defaults and bounds.

`farm` and `metric` do not know each other; this is where their agreement is held.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import fields
from typing import Any, get_args

import pytest
from annotated_types import Ge, Le
from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from plateau.farm.model.spec import RuleSpec, ViewSpec
from plateau.metric import RULES, View

SPECIFIED: dict[str, type[BaseModel]] = {
    model.model_fields["name"].default: model for model in get_args(get_args(RuleSpec)[0])
}


def test_rules_and_their_defaults_agree() -> None:
    specified = {
        rule: {name: one.default for name, one in model.model_fields.items() if name != "name"}
        for rule, model in SPECIFIED.items()
    }
    existing = {
        name: {field.name: field.default for field in fields(rule) if field.init}
        for name, rule in RULES.items()
    }
    assert specified == existing


def test_views_and_their_defaults_agree() -> None:
    view = {field.name: field.default for field in fields(View)}
    for name, field in ViewSpec.model_fields.items():
        assert view[name] == field.default


def numbers() -> Iterator[Any]:
    """Each number of a rule or a view: who specifies it, who judges by it, its name and field."""
    both = [(SPECIFIED[name], RULES[name], name) for name in RULES] + [(ViewSpec, View, "view")]
    for model, judge, whose in both:
        for name, field in model.model_fields.items():
            if field.annotation in {int, float}:
                yield pytest.param(model, judge, name, field, id=f"{whose}.{name}")


def bounds(field: FieldInfo) -> tuple[float, float]:
    """The least and the greatest value that a spec may have there."""
    [least] = [one.ge for one in field.metadata if isinstance(one, Ge)]
    [most] = [one.le for one in field.metadata if isinstance(one, Le)]
    assert isinstance(least, int | float)
    assert isinstance(most, int | float)
    return least, most


@pytest.mark.parametrize(("model", "judge", "name", "field"), list(numbers()))
def test_bounds_agree(
    model: Callable[..., object], judge: Callable[..., object], name: str, field: FieldInfo
) -> None:
    least, most = bounds(field)
    is_whole = field.annotation is int
    below = least - 1 if is_whole else math.nextafter(least, -math.inf)
    above = most + 1 if is_whole else math.nextafter(most, math.inf)
    for allowed in (least, most):
        model(**{name: allowed})
        judge(**{name: allowed})
    for refused in (below, above, math.nan, math.inf):
        with pytest.raises(ValidationError):
            model(**{name: refused})
        with pytest.raises(ValueError, match=name):
            judge(**{name: refused})
