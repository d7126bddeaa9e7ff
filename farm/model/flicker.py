"""What the frames of a sequence have to have in common to stop at the same visible noise.

Frames that stop with different amounts of noise flicker. How much is left in one is decided by its
rule with the target, by the least spp, by how often it is judged and by how it is looked at. Jobs
that are alike in these are *even*; a batch with a guarded job takes even ones only.
"""

from dataclasses import dataclass
from typing import Final

from plateau.farm.model.spec import JobSpec

#: The fields of a spec that even jobs have in common.
EVEN: Final = ("rule", "min_spp", "step", "view")

Value = str | int | float | bool | None


@dataclass(frozen=True)
class Difference:
    """A field in which one job stops otherwise than the others."""

    field: str
    value: Value
    others: Value


def stops_by(spec: JobSpec) -> dict[str, Value]:
    """What decides how much noise is left in a job's image: values by the names of their fields."""
    values: dict[str, Value] = {}
    for name, value in spec.model_dump(include=set(EVEN)).items():
        if isinstance(value, dict):
            values |= {f"{name}.{part}": _value(one) for part, one in value.items()}
        else:
            values[name] = value
    return values


def _value(part: Value | tuple[float, ...]) -> Value:
    return ", ".join(f"{one:g}" for one in part) if isinstance(part, tuple) else part


def differences(values: dict[str, Value], others: dict[str, Value]) -> list[Difference]:
    """Where `stops_by` of a job differs from that of others; of another rule, just its name."""
    names = sorted(values.keys() | others.keys())
    if values["rule.name"] != others["rule.name"]:
        names = [name for name in names if name == "rule.name" or not name.startswith("rule.")]
    return [
        Difference(name, values.get(name), others.get(name))
        for name in names
        if values.get(name) != others.get(name)
    ]
