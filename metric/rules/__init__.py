"""Stopping rules, by name, on one interface.

The reasons are in docs/decisions/stopping.md.
"""

from __future__ import annotations

from dataclasses import fields
from types import MappingProxyType
from typing import TYPE_CHECKING

from plateau.metric.rules.base import Evidence, Json, Memory, Rule, Verdict
from plateau.metric.rules.fixed import Fixed
from plateau.metric.rules.multiple import Multiple
from plateau.metric.rules.myszkowski import Myszkowski
from plateau.metric.rules.reverse import Reverse
from plateau.metric.rules.successive import Successive
from plateau.metric.rules.visible import Visible

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = [
    "RULES",
    "Evidence",
    "Fixed",
    "Json",
    "Memory",
    "Multiple",
    "Myszkowski",
    "Reverse",
    "Rule",
    "Successive",
    "Verdict",
    "Visible",
    "create_rule",
]

#: Every rule that a job can name.
RULES: Mapping[str, type[Rule]] = MappingProxyType(
    {rule.name: rule for rule in (Fixed, Successive, Multiple, Reverse, Myszkowski, Visible)}
)


def create_rule(name: str, **parameters: object) -> Rule:
    """Return a fresh rule of this name; parameters left out take the paper's values.

    Raises
    ------
    ValueError
        If there is no such rule, or it has no such parameter, or a value is out of its domain.

    Examples
    --------
    >>> create_rule("reverse", window=8)
    Reverse(window=8, epsilon=0.1)
    """
    if name not in RULES:
        raise ValueError(f"there is no rule {name!r}; the rules are {', '.join(sorted(RULES))}")
    rule = RULES[name]
    known = [parameter.name for parameter in fields(rule) if parameter.init]
    for parameter in parameters:
        if parameter not in known:
            raise ValueError(
                f"the rule {name!r} has no parameter {parameter!r}; it has {', '.join(known)}"
            )
    try:
        return rule(**parameters)
    except TypeError as error:
        raise ValueError(f"the rule {name!r}: {error}") from error
