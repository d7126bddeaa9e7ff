"""The fields that the frames of a sequence must share to stop at the same visible noise.

Frames that stop with different amounts of noise flicker. The amount depends on the rule and its
target, on the least spp, the step and the view, and on whether the image is denoised. Jobs with the
same of these are *even*; a guarded batch takes only even jobs.
"""

from dataclasses import dataclass
from typing import Final

from plateau.farm.model.spec import JobSpec

#: The fields of a spec that even jobs share.
EVEN: Final = ("rule", "min_spp", "step", "view", "denoise")

Value = str | int | float | bool | None


@dataclass(frozen=True)
class Difference:
    """A field in which one job stops otherwise than the others."""

    field: str
    value: Value
    others: Value


def stops_by(spec: JobSpec) -> dict[str, Value]:
    """The values that decide how much noise a job leaves, by the names of their fields."""
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
    """Differences between a job's `stops_by` and others'; of another rule only the name."""
    names = sorted(values.keys() | others.keys())
    if values["rule.name"] != others["rule.name"]:
        names = [name for name in names if name == "rule.name" or not name.startswith("rule.")]
    return [
        Difference(name, values.get(name), others.get(name))
        for name in names
        if values.get(name) != others.get(name)
    ]
