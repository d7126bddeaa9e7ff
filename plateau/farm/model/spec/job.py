"""The specifications of a job and of a batch: what they share, and the scene's parameters."""

from functools import lru_cache
from typing import Annotated, Final

from pydantic import BeforeValidator, Field, model_validator

from plateau.farm.model.passes import MOST_SLICE_SPP
from plateau.farm.model.seeds import JOB_SEEDS, SeedSchedule
from plateau.farm.model.spec import texts
from plateau.farm.model.spec.parts import LEAST_FRAMES
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
Parameters = Annotated[
    dict[str, Annotated[str | _WholeNumber | float | bool, _FROM_NUMPY]], texts.PARAMETERS
]


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
    frame_seed: int = Field(
        default=0,
        ge=0,
        le=JOB_SEEDS - 1,
        description="the part of `seed` that differs between the frames of a batch, 0 for the "
        "first; where a scalar variant has too few seeds for all frames, they repeat",
    )

    def parameter_strings(self) -> dict[str, str]:
        """`parameters` as Mitsuba reads them."""
        return parameter_strings(self.parameters)

    def seed_schedule(self, variant: str, width: int, height: int) -> SeedSchedule:
        """The passes and seeds of its slices: on a variant, of a film of this size in pixels.

        Raises
        ------
        SeedsExhausted
            The variant has too few seeds for it.
        """
        return SeedSchedule(
            variant,
            width,
            height,
            self.slice_spp,
            self.max_spp,
            self.seed,
            MOST_SLICE_SPP if self.by_zones else 0,
            self.frame_seed,
            self.inputs,
        )


@lru_cache
def stored_spec(text: str) -> JobSpec:
    """The spec as Redis has it; to be read alone, as several records share it."""
    return JobSpec.model_validate_json(text)


class BatchSpec(SharedSpec):
    """Many jobs that are alike but for the scene's parameters, one for each entry of a list."""

    parameters: tuple[Parameters, ...] = Field(
        min_length=1,
        max_length=MAX_ENTRIES,
        description="for each job the values for the scene's $parameters, in their order",
    )
    same_seeds: bool = Field(
        default=False,
        description="draw the same samples in all frames, so that their noise stands still before "
        "what moves, where it is seen more; by default the first job has the seed `seed`, and each "
        "further one the next",
    )
    first_frame: int = Field(
        default=0,
        ge=0,
        le=JOB_SEEDS - 1,
        description="which frame of a longer list the first entry is: seeds are counted from there",
    )

    @model_validator(mode="after")
    def _has_frames(self) -> "BatchSpec":
        if self.shot is not None and len(self.parameters) < LEAST_FRAMES:
            raise ValueError(
                f"a shot has {LEAST_FRAMES} frames or more, and `parameters` an entry for each: "
                f"it has {len(self.parameters)}"
            )
        return self

    def job_specs(self, batch: str) -> list[JobSpec]:
        """The spec of each job, in a batch of this name."""
        shared = {name: getattr(self, name) for name in SharedSpec.model_fields} | {"batch": batch}
        return [
            JobSpec(**shared | self._seeds(place), parameters=values)
            for place, values in enumerate(self.parameters)
        ]

    def _seeds(self, place: int) -> dict[str, int]:
        frame_seed = 0 if self.same_seeds else (self.first_frame + place) % JOB_SEEDS
        return {"seed": (self.seed + frame_seed) % JOB_SEEDS, "frame_seed": frame_seed}
