"""The rules that are compared, with the paper's parameters if it gives any."""

from __future__ import annotations

from typing import TYPE_CHECKING

from plateau.metric import create_rule

if TYPE_CHECKING:
    from plateau.metric import Rule

#: The share of pixels still visibly wrong at which a rule should stop.
TARGET = 0.001


def contenders() -> dict[str, Rule]:
    """Return fresh rules by name."""
    return {
        "successive": create_rule("successive"),
        "multiple, window 5": create_rule("multiple", window=5),
        "multiple, window 8": create_rule("multiple", window=8),
        "reverse": create_rule("reverse"),
        "myszkowski": create_rule("myszkowski"),
        "visible": create_rule("visible"),
        "visible, 0.1 %": create_rule("visible", target=TARGET),
    }
