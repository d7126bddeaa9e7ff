"""Stopping rules, one module for each: its description, its judgement and its memory.

The reasons are in docs/decisions/stopping.md.
"""

from plateau.metric.rules.base import Rule
from plateau.rules import create


def create_rule(name: str, **parameters: object) -> Rule:
    """Return a fresh rule of this name; omitted parameters have their defaults.

    Raises
    ------
    ValueError
        If there is no such rule, it has no such parameter, a value is out of its bounds, or the
        rule cannot judge.

    Examples
    --------
    >>> create_rule("reverse", window=8)
    Reverse(window=8, epsilon=0.1)
    """
    rule = create(name, **parameters)
    if not isinstance(rule, Rule):
        raise ValueError(f"the rule {name!r} does not judge: it is no plateau.metric.Rule")
    return rule
