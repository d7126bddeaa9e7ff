"""The base of the models that check a job's specification, and the model of each rule."""

from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, create_model

from plateau.farm.model import input_errors
from plateau.farm.model.errors import InvalidSpec
from plateau.rules import Parameter, StoppingRule, create


class Strict(BaseModel):
    """A frozen model that refuses unknown fields.

    Each number has inclusive bounds: a form, a schema and the metric share them, and a value out of
    bounds is refused before anything is rendered.

    Defaults are given by name (``Field(default=…)``): type checkers see no others.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    if not TYPE_CHECKING:  # a type checker would take any fields

        def __new__(cls, **fields: Any) -> "Strict":
            """Refuse wrong fields in our words where a program names them."""
            try:
                if fields:
                    cls.__pydantic_validator__.validate_python(fields)
            except ValidationError as error:
                located = [(one["loc"], one) for one in error.errors(include_url=False)]
                wrong = input_errors.by_field(located, with_values=True).items()
                words = "; ".join(": ".join(filter(None, one)) for one in wrong)
                raise InvalidSpec(words) from None
            return super().__new__(cls)


class RuleModel(Strict):
    """A rule in a job's specification: its name and its parameters."""

    name: str

    @property
    def behaviour(self) -> StoppingRule:
        """The rule itself."""
        return create(**self.model_dump())


def rule_model(rule: type[StoppingRule], module: str) -> type[RuleModel]:
    """The model of a rule in a job's specification, for the module of this name."""
    fields: dict[str, Any] = {
        "name": (Literal[rule.name], rule.name),
        **{name: _field(one) for name, one in rule.parameters().items()},
    }
    made: type[RuleModel] = create_model(
        f"{rule.__name__}Spec",
        __base__=RuleModel,
        __doc__=rule.help,
        __module__=module,
        **fields,
    )
    return made


def _field(parameter: Parameter) -> tuple[Any, Any]:
    kind: Any = Annotated[
        int if parameter.is_whole else float, Field(ge=parameter.least, le=parameter.most)
    ]
    return kind, Field(default=parameter.default, description=parameter.description)
