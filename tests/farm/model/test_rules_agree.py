"""What repeats the rules and the view says the same: specs, type checkers' stub, documentation."""

import math
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import fields
from typing import Any

import pytest
from annotated_types import Ge, Le
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from plateau.farm.model.errors import InvalidSpec
from plateau.farm.model.spec import JobSpec, ViewSpec
from plateau.farm.model.spec.parts import LEAST_SIDE, ShotSpec
from plateau.farm.model.spec.rule_specs import SPECS
from plateau.metric import View
from plateau.metric.cvvdp import LEAST_SIZE
from plateau.metric.cvvdp.video import LEAST_FPS, MOST_FPS
from plateau.rules import DEFAULT, rules
from tests import rule_files


def test_a_shot_is_within_what_the_metric_judges() -> None:
    fps, target = (ShotSpec.model_fields[name].metadata for name in ("fps", "target"))
    assert [one for one in fps if isinstance(one, Ge | Le)] == [Ge(LEAST_FPS), Le(MOST_FPS)]
    jod = SPECS["jod"].model_fields["target"]
    assert [one for one in target if isinstance(one, Ge | Le)] == [
        one for one in jod.metadata if isinstance(one, Ge | Le)
    ]
    assert ShotSpec.model_fields["target"].default == jod.default
    assert LEAST_SIDE == LEAST_SIZE == SPECS["jod"]().behaviour.least_side


def test_rules_and_their_defaults_agree() -> None:
    specified = {
        rule: {name: one.default for name, one in model.model_fields.items() if name != "name"}
        for rule, model in SPECS.items()
    }
    existing = {
        name: {field.name: field.default for field in fields(rule) if field.init}
        for name, rule in rules().items()
    }
    assert specified == existing
    assert JobSpec().rule.name == DEFAULT


def test_type_checkers_and_readers_are_told_the_same() -> None:
    assert rule_files.STUB.read_text() == rule_files.stub(), "`make manual` writes it"
    page = rule_files.DOCS.read_text()
    assert page == rule_files.documented(page, rule_files.table(page)), (
        "`make manual` writes its table"
    )


def test_rules_are_listed_without_numerics() -> None:
    program = "import sys, plateau.rules as r; r.as_offered(); print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert "plateau.metric.rules.visible" in loaded.stdout, loaded.stderr
    assert {"numpy", "numba", "pydantic"}.isdisjoint(loaded.stdout.split())


def test_views_and_their_defaults_agree() -> None:
    view = {field.name: field.default for field in fields(View)}
    assert view.items() >= ViewSpec().of_display().items()


def numbers() -> Iterator[Any]:
    """Each number of a rule or a view: who specifies it, who judges by it, its name and field."""
    both: list[tuple[type[BaseModel], type, str]] = [
        *((SPECS[name], rule, name) for name, rule in rules().items()),
        (ViewSpec, View, "view"),
    ]
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
        with pytest.raises(InvalidSpec):
            model(**{name: refused})
        with pytest.raises(ValueError, match=name):
            judge(**{name: refused})
