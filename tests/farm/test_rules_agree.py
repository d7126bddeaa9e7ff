"""The rules that a job may name are the metric's, with the same parameters and defaults.

`farm` and `metric` do not know each other; this is where their agreement is held.
"""

from dataclasses import fields
from typing import get_args

from farm.spec import RuleSpec, ViewSpec
from metric import RULES, View


def test_rules_and_their_defaults_agree() -> None:
    specified = {
        model.model_fields["name"].default: {
            name: field.default for name, field in model.model_fields.items() if name != "name"
        }
        for model in get_args(get_args(RuleSpec)[0])
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
