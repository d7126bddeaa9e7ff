"""The specifications of a job and of a batch: what they share, and the scene's parameters."""

from typing import Annotated, Final

from pydantic import BeforeValidator, Field, model_validator

from plateau.farm.model.spec.shared import SharedSpec

#: A list of parameters makes at most so many jobs.
MAX_ENTRIES: Final = 1000

#: Any that 64 bits hold; more digits would be no number to any renderer.
_WholeNumber = Annotated[int, Field(ge=-(2**63), le=2**63 - 1)]

#: A number of numpy becomes one of Python.
_FROM_NUMPY: Final = BeforeValidator(
    lambda value: value.item() if type(value).__module__ == "numpy" else value
)

#: Values for a scene's ``$parameters``.
Parameters = dict[str, Annotated[str | _WholeNumber | float | bool, _FROM_NUMPY]]


def parameter_strings(parameters: Parameters) -> dict[str, str]:
    """The parameters as Mitsuba reads them: text, with lower-case booleans."""
    return {
        name: str(value).lower() if isinstance(value, bool) else str(value)
        for name, value in parameters.items()
    }


class JobSpec(SharedSpec):
    """A job: how one image is sampled, judged and stopped."""

    parameters: Parameters = Field(
        default_factory=dict, description="values for the scene's $parameters, as mitsuba -D"
    )

    @model_validator(mode="after")
    def _guards_a_batch(self) -> "JobSpec":
        if self.flicker_guard and self.batch is None:
            raise ValueError("flicker_guard guards a batch, and there is none: name one as batch")
        return self

    def parameter_strings(self) -> dict[str, str]:
        """`parameters` as Mitsuba reads them."""
        return parameter_strings(self.parameters)


def stored_spec(text: str) -> JobSpec:
    """The spec as Redis has it, without what a newer Plateau has added to specs.

    That one does without these fields where they are left out, or an older one such as this is not
    let into its farm; see `plateau.farm.model.versions`.
    """
    return JobSpec.model_validate_json(text, extra="ignore")


class BatchSpec(SharedSpec):
    """Many jobs that are alike but for the scene's parameters, one for each entry of a list."""

    parameters: tuple[Parameters, ...] = Field(
        min_length=1,
        max_length=MAX_ENTRIES,
        description="for each job the values for the scene's $parameters, in their order",
    )

    def job_specs(self, batch: str) -> list[JobSpec]:
        """The spec of each job, in a batch of this name."""
        shared = {name: getattr(self, name) for name in SharedSpec.model_fields}
        return [
            JobSpec(**{**shared, "batch": batch}, parameters=values) for values in self.parameters
        ]
