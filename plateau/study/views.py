"""The bodies of requests and answers about observer studies."""

from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, StringConstraints

from plateau.farm.wire.json_numbers import WithWholeNumbers
from plateau.study import examples
from plateau.study.model import MOST_LEVELS, MOST_STUDIES, Answer, Observer, Screen, Study
from plateau.study.order import Method, Side

_JobId = Annotated[str, StringConstraints(pattern=r"^[0-9a-f]{12}$")]


def _shows(example: dict[str, Any]) -> Any:
    return {"examples": [example]}


class LevelResult(BaseModel):
    """The answers at one level."""

    spp: int
    shown: int = Field(description="answers")
    seen: int = Field(description="of these, how often a difference was seen")


class Threshold(BaseModel):
    """The spp at which a difference is seen with a given probability."""

    probability: float = Field(description="to see a difference")
    spp: float
    low_spp: float = Field(description="95 % interval")
    high_spp: float


class StudyResult(BaseModel):
    """A study's results so far."""

    observers: int
    finished: int = Field(description="observers who have answered all their pairs")
    answers: int
    levels: list[LevelResult] = Field(description="by rising spp")
    a: float | None = Field(
        description="of p = 1 / (1 + e^-(a·spp + b)), fitted to all answers (Firth); null while "
        "there are fewer than 20, or more samples do not help"
    )
    b: float | None
    thresholds: list[Threshold] = Field(
        description="where p is 0.5 and 0.1, as far as the answers bound it; none without a fit"
    )
    suggested_levels: list[int] = Field(
        description="for a study by constant stimuli: seven levels at equal distances over the "
        "interval in which the answers change"
    )


class NewStudy(WithWholeNumbers):
    """A request to make a study."""

    model_config = ConfigDict(
        extra="forbid", strict=True, json_schema_extra=_shows(examples.NEW_STUDY)
    )

    job_id: _JobId = Field(description="an ended job that kept its slices (`keep_slices`)")
    reference_job_id: _JobId | None = Field(
        default=None,
        description="another such job of the same size, preferably of the same scene with another "
        "`seed`; null takes all slices of the job itself",
    )
    method: Method = Field(default="constant", description="see the study's")
    levels: list[Annotated[int, Field(ge=1, le=1_000_000)]] | None = Field(
        default=None,
        max_length=MOST_LEVELS,
        description="spp of the test images, in whole slices; null takes the paper's levels, "
        "1 % to 25 % of the reference's spp",
    )
    name: (
        Annotated[
            str, StringConstraints(min_length=1, max_length=200, pattern=r"^[^\x00-\x1f\x7f]+$")
        ]
        | None
    ) = Field(default=None, description="the study's name in tables; null takes the job's name")


class StudyView(Study):
    """A study, with its results and the paths of its files."""

    model_config = ConfigDict(json_schema_extra=_shows(examples.STUDY))

    trials: int = Field(description="pairs that each observer is shown")
    result: StudyResult
    links: dict[str, str] = Field(description="paths of its pictures and tables, and of the page")


class StudyList(BaseModel):
    """All studies."""

    model_config = ConfigDict(json_schema_extra=_shows(examples.STUDIES))

    studies: list[StudyView] = Field(
        description=f"newest first; a farm keeps {MOST_STUDIES} at most"
    )


class TakingPart(BaseModel):
    """A request to take part."""

    model_config = ConfigDict(
        extra="forbid", strict=True, json_schema_extra=_shows(examples.TAKING_PART)
    )

    screen: Screen


class Trial(BaseModel):
    """A pair as it is shown."""

    trial: int = Field(description="its place in the order, from 0")
    left: str = Field(description="path of the picture at the left")
    right: str
    reference: Side


class ObserverView(Observer):
    """An observer, their pairs, and which of these they have answered."""

    model_config = ConfigDict(json_schema_extra=_shows(examples.OBSERVER))

    pixels_per_degree: float
    trials: list[Trial] = Field(description="the pairs, in an order that never changes")
    answered: list[int] = Field(description="the numbers of the pairs that have an answer")


class NewAnswer(BaseModel):
    """A request to answer a pair."""

    model_config = ConfigDict(
        extra="forbid", strict=True, json_schema_extra=_shows(examples.NEW_ANSWER)
    )

    seen: bool = Field(description="whether a difference is seen")
    seconds: float = Field(
        ge=0, le=86_400, strict=False, description="from the pair's appearance to the answer"
    )


class AnswerView(Answer):
    """The answer that counts."""

    model_config = ConfigDict(json_schema_extra=_shows(examples.ANSWER))


def study_view(study: Study, result: StudyResult) -> StudyView:
    """The study as the API shows it."""
    root = f"/v1/studies/{study.id}"
    return StudyView(
        **study.model_dump(),
        trials=len(study.pairs(0)),
        result=result,
        links={
            "self": root,
            "reference": f"{root}/reference.png",
            "trials_csv": f"{root}/trials.csv",
            "page": f"/studies/{study.id}",
            "observe": f"/studies/{study.id}/observe",
        },
    )


def observer_view(study: Study, observer: Observer, answers: list[Answer]) -> ObserverView:
    """The observer as the API shows them; `answers` are the study's."""
    root = f"/v1/studies/{study.id}"
    reference = f"{root}/reference.png"
    trials = []
    for number, pair in enumerate(study.pairs(observer.number)):
        test = f"{root}/levels/{pair.spp}.png"
        left, right = (reference, test) if pair.reference == "left" else (test, reference)
        trials.append(Trial(trial=number, left=left, right=right, reference=pair.reference))
    return ObserverView(
        **observer.model_dump(),
        pixels_per_degree=observer.screen.pixels_per_degree,
        trials=trials,
        answered=[one.trial for one in answers if one.observer == observer.name],
    )
