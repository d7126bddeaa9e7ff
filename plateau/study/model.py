"""The model of observer studies: what is compared, who took part, and the answers."""

import math
from dataclasses import dataclass
from datetime import datetime
from typing import Final

from pydantic import BaseModel, ConfigDict, Field

from plateau.farm.model.errors import FarmError
from plateau.study.order import Method, Pair, Side, pairs

MOST_STUDIES: Final = 200  #: in a farm; bounds the space of their pictures
MOST_OBSERVERS: Final = 500  #: in a study
MOST_LEVELS: Final = 24  #: in a study
MOST_PIXELS: Final = 2560 * 1440  #: in a picture; no screen shows two larger ones side by side

#: The paper's thresholds: a difference is perceived by half of the observers, and by a tenth.
PROBABILITIES: Final = (0.5, 0.1)

#: An observer's name, which no spreadsheet takes for a formula.
PSEUDONYM: Final = r"^[A-Za-z0-9][A-Za-z0-9_-]{0,31}$"


@dataclass(frozen=True)
class KeptSlice:
    """The blob of a slice, and the digest that it must have."""

    blob: str
    sha256: str


class StudyNotFound(FarmError):
    """No study has this id."""

    def __init__(self, study_id: str) -> None:
        super().__init__(f"there is no study {study_id!r}")


class ObserverNotFound(FarmError):
    """Nobody takes part in the study under this name."""

    def __init__(self, study_id: str, name: str) -> None:
        super().__init__(
            f"nobody takes part in study {study_id} as {name!r}; PUT "
            f"/v1/studies/{study_id}/observers/{name} takes part"
        )


class TrialNotFound(FarmError):
    """The observer has no pair of this number."""

    def __init__(self, study_id: str, trial: int, trials: int) -> None:
        super().__init__(
            f"study {study_id} shows each observer {trials} pairs, numbered from 0: there is no "
            f"pair {trial}"
        )


class CannotStudy(FarmError):
    """The study cannot be made, or takes no more observers."""


class Study(BaseModel):
    """A study: images of a job's first slices, to be compared with a reference."""

    model_config = ConfigDict(frozen=True)

    id: str
    name: str
    method: Method = Field(
        description="`constant`: constant stimuli, for the thresholds; `limits`: rising and "
        "falling, to find the interval in which they lie"
    )
    job_id: str = Field(description="the job whose first slices make the test images")
    reference_job_id: str = Field(description="the job whose slices all make the reference")
    independent: bool = Field(
        description="whether the reference has its own samples; otherwise it contains those of the "
        "test images, which seem closer to it than they are"
    )
    levels: tuple[int, ...] = Field(description="spp of the test images, rising")
    reference_spp: int
    slice_spp: int = Field(description="of the job; levels are multiples of it")
    exposure_ev: float = Field(description="of all images: the exposure of the job's view")
    width: int
    height: int
    owner: str | None = Field(default=None, description="id of the key that made the study")
    created_at: datetime

    def pairs(self, number: int) -> tuple[Pair, ...]:
        """The pairs in the order in which the observer of this number sees them."""
        return pairs(self.id, self.levels, self.method, number)


class Screen(BaseModel):
    """An observer's own account of screen and seat, which a browser cannot measure."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    viewing_distance_cm: float = Field(ge=10, le=1000, description="from eye to screen")
    pixel_pitch_mm: float = Field(
        ge=0.02, le=5, description="distance of pixels, by a card held against the screen"
    )
    gamma_matches: bool | None = Field(
        default=None,
        description="whether fine black and white lines looked as bright as the grey beside them; "
        "null if the observer did not look",
    )

    @property
    def pixels_per_degree(self) -> float:
        """Pixels in a degree of visual angle, at the middle of the screen."""
        pitch_cm = self.pixel_pitch_mm / 10
        return 2 * self.viewing_distance_cm * math.tan(math.radians(0.5)) / pitch_cm


class Observer(BaseModel):
    """An observer of a study."""

    model_config = ConfigDict(frozen=True)

    name: str = Field(description="the pseudonym")
    number: int = Field(description="from 0, by time of joining; it sets the order of pairs")
    screen: Screen
    joined_at: datetime


class Answer(BaseModel):
    """An observer's answer to a pair."""

    model_config = ConfigDict(frozen=True)

    observer: str
    trial: int = Field(description="the pair's place in the observer's order, from 0")
    spp: int = Field(description="of the test image")
    reference: Side = Field(description="the reference's side")
    seen: bool = Field(description="whether a difference was seen")
    seconds: float = Field(description="from the pair's appearance to the answer")
    at: datetime
