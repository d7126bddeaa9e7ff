"""The API's views of the stopping rules, for forms."""

from typing import Final

from pydantic import BaseModel, ConfigDict, Field
from pydantic.config import JsonDict

from plateau.rules import DEFAULT, ParameterRole, as_offered

_EXAMPLE: Final[JsonDict] = {
    "name": "fixed",
    "title": "A number of samples",
    "help": "Stops at a number of samples, whatever the image looks like.",
    "default": False,
    "featured": False,
    "quantity": "",
    "unit": "",
    "by_quality": False,
    "is_error": False,
    "parameters": [
        {
            "name": "spp",
            "label": "Stop at",
            "unit": "spp",
            "help": "Samples per pixel.",
            "default": 10_000,
            "least": 1,
            "most": 1_000_000,
            "whole": True,
            "scale": 1,
            "role": "end_spp",
        }
    ],
}


class ParameterView(BaseModel):
    """A parameter of a stopping rule, as a form asks for it."""

    name: str
    label: str
    unit: str = Field(description="what stands behind its field; empty for none")
    help: str = Field(description="a sentence below its field")
    default: int | float
    least: int | float = Field(description="the least value, which is allowed")
    most: int | float = Field(description="the greatest value, which is allowed")
    whole: bool = Field(description="whether it takes whole numbers only")
    scale: float = Field(description="a form shows the value divided by this: 0.01 for percent")
    role: ParameterRole | None = Field(
        description="what it means beyond the rule: it stops at this many spp (`end_spp`), or not "
        "before (`least_spp`); at this share of noise left (`noise_target`); at this value of its "
        "own `quantity` (`value_target`); at this slope of the curve (`slope`), in changed "
        "pixels per spp at 512×512, over so many points (`window`)"
    )


class RuleView(BaseModel):
    """A stopping rule, as a form offers it."""

    model_config = ConfigDict(json_schema_extra={"examples": [_EXAMPLE]})

    name: str = Field(description="how a job's `rule` names it")
    title: str
    help: str = Field(description="a sentence or two below the title")
    default: bool = Field(description="whether a job has it that names none")
    featured: bool = Field(description="whether it is among the first to be offered")
    quantity: str = Field(
        description="what its values on a curve are, such as quality; empty where the points have "
        "that anyway"
    )
    unit: str = Field(description="of these values")
    by_quality: bool = Field(
        description="whether they are the quality by ColorVideoVDP; a job with the rule has "
        "quality.png"
    )
    is_error: bool = Field(description="whether they are an error, for a logarithmic axis")
    parameters: list[ParameterView]


class Rules(BaseModel):
    """The stopping rules that this service has, in the order in which to offer them."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"rules": [_EXAMPLE]}]})

    rules: list[RuleView]


def rules_view() -> Rules:
    """Every rule that is installed."""
    return Rules(
        rules=[
            RuleView(
                name=rule.name,
                title=rule.title,
                help=rule.help,
                default=rule.name == DEFAULT,
                featured=rule.featured,
                quantity=rule.quantity,
                unit=rule.unit,
                by_quality=rule.by_quality,
                is_error=rule.is_error,
                parameters=[
                    ParameterView(name=name, whole=one.is_whole, **vars(one))
                    for name, one in rule.parameters().items()
                ],
            )
            for rule in as_offered()
        ]
    )
