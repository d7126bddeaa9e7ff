"""The models by which a job's specification is checked: strict ones, and one made of each rule."""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, create_model

from plateau.rules import Parameter, StoppingRule, create


class Strict(BaseModel):
    """Frozen, and unknown fields are refused.

    Each number has a least and a greatest value, both allowed: so a form, a schema and the metric
    can have the very same, and what is out of bounds is refused before anything is rendered.

    Defaults are given by name (``Field(default=…)``): from one by position, a user's type checker
    would not learn that the field may be left out.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class RuleModel(Strict):
    """A rule as a job names it: its name and its parameters."""

    name: str

    @property
    def behaviour(self) -> StoppingRule:
        """The rule itself, by which to know what it does."""
        return create(**self.model_dump())


def rule_model(rule: type[StoppingRule], module: str) -> type[RuleModel]:
    """The model of what a job may say of a rule, for a module to have."""
    fields: dict[str, Any] = {
        "name": (Literal[rule.name], rule.name),
        **{name: _field(one) for name, one in rule.parameters().items()},
    }
    made: type[RuleModel] = create_model(
        f"{rule.__name__}Spec",
        __base__=RuleModel,
        __doc__=rule.summary,
        __module__=module,
        **fields,
    )
    return made


def _field(parameter: Parameter) -> tuple[Any, Any]:
    kind: Any = Annotated[
        int if parameter.is_whole else float, Field(ge=parameter.least, le=parameter.most)
    ]
    return kind, Field(default=parameter.default, description=parameter.description)
