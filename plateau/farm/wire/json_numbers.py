"""Whole numbers in JSON, which has one kind of number: 10.0 is 10, also to JSON Schema."""

from typing import Any, Final

from pydantic import BaseModel, model_validator

#: Beyond it a float stands for several whole numbers.
_MOST: Final = 2**53
#: These go to Mitsuba as text, as they were written.
_AS_WRITTEN: Final = "parameters"


def whole_numbers(value: Any) -> Any:
    """JSON with whole numbers as integers, except a scene's parameters."""
    if isinstance(value, dict):
        return {
            name: one if name == _AS_WRITTEN else whole_numbers(one) for name, one in value.items()
        }
    if isinstance(value, list):
        return [whole_numbers(one) for one in value]
    if isinstance(value, float) and value.is_integer() and abs(value) < _MOST:
        return int(value)
    return value


class WithWholeNumbers(BaseModel):
    """A body in which 10.0 is 10."""

    @model_validator(mode="before")
    @classmethod
    def _whole(cls, body: Any) -> Any:
        return whole_numbers(body)
