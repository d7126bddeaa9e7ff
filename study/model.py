"""Observer studies as the API shows them: what is compared, who took part, what was answered."""

import math
from datetime import datetime
from typing import Final

from pydantic import BaseModel, ConfigDict, Field

from plateau.farm.model.errors import FarmError
from plateau.study.order import Method, Pair, Side, pairs

#: A farm has so many studies at most, so that their pictures stay bounded.
MOST_STUDIES: Final = 200
#: A study has so many observers at most.
MOST_OBSERVERS: Final = 500
#: And so many levels.
MOST_LEVELS: Final = 24
#: A picture has so many pixels at most: two of more would not fit side by side on any screen.
MOST_PIXELS: Final = 2560 * 1440

#: What an observer may be called: nothing that a spreadsheet takes for a formula.
PSEUDONYM: Final = r"^[A-Za-z0-9][A-Za-z0-9_-]{0,31}$"


class StudyNotFound(FarmError):
    """There is no observer study of this id."""

    def __init__(self, study_id: str) -> None:
        super().__init__(f"there is no study {study_id!r}")
        self.study_id = study_id


class ObserverNotFound(FarmError):
    """Nobody takes part in the study under this name."""

    def __init__(self, study_id: str, name: str) -> None:
        super().__init__(
            f"nobody takes part in study {study_id} as {name!r}; PUT "
            f"/v1/studies/{study_id}/observers/{name} takes part"
        )


class TrialNotFound(FarmError):
    """The observer is shown no pair of this number."""

    def __init__(self, study_id: str, trial: int, trials: int) -> None:
        super().__init__(
            f"study {study_id} shows each observer {trials} pairs, numbered from 0: there is no "
            f"pair {trial}"
        )
        self.trial = trial


class CannotStudy(FarmError):
    """No study can be made so, or taken part in."""


class Study(BaseModel):
    """A study: images of a job's first slices, to be compared with a reference."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    id: str
    name: str
    method: Method = Field(
        description="`constant`: constant stimuli, for the thresholds; `limits`: rising and "
        "falling, to find the interval in which they lie"
    )
    job_id: str = Field(description="whose first slices the test images are")
    reference_job_id: str = Field(description="whose slices the reference is: all of them")
    independent: bool = Field(
        description="whether the reference has samples of its own; else the test images are parts "
        "of it, and seem closer to it than they are"
    )
    levels: tuple[int, ...] = Field(description="spp of the test images, rising")
    reference_spp: int
    slice_spp: int = Field(description="of the job: levels are multiples of it")
    exposure_ev: float = Field(description="of all images, as the job's view has it")
    width: int
    height: int
    owner: str | None = Field(default=None, description="id of the key that made it")
    created_at: datetime

    def pairs(self, number: int) -> tuple[Pair, ...]:
        """The pairs in the order in which the observer of this number sees them."""
        return pairs(self.id, self.levels, self.method, number)


class Screen(BaseModel):
    """What an observer said of screen and seat; the browser can measure none of it."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    viewing_distance_cm: float = Field(ge=10, le=1000, description="from eye to screen")
    pixel_pitch_mm: float = Field(
        ge=0.02, le=5, description="from pixel to pixel, by a card held against the screen"
    )
    gamma_matches: bool | None = Field(
        default=None,
        description="whether fine black and white lines looked as bright as the grey beside them; "
        "null where nobody looked",
    )

    @property
    def pixels_per_degree(self) -> float:
        """Pixels in a degree of visual angle, at the middle of the screen."""
        pitch_cm = self.pixel_pitch_mm / 10
        return 2 * self.viewing_distance_cm * math.tan(math.radians(0.5)) / pitch_cm


class Observer(BaseModel):
    """Somebody who takes part."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    name: str = Field(description="the pseudonym")
    number: int = Field(description="from 0, in the order of coming; it sets the order of pairs")
    screen: Screen
    joined_at: datetime


class Answer(BaseModel):
    """What an observer answered to a pair."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    observer: str
    trial: int = Field(description="the pair's place in the observer's order, from 0")
    spp: int = Field(description="of the test image")
    reference: Side = Field(description="at which side the reference was")
    seen: bool = Field(description="whether a difference was seen")
    seconds: float = Field(description="from the pair's appearance to the answer")
    at: datetime
