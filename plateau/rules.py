"""The description of a stopping rule, and the list of installed rules.

A rule is one class in one file: its parameters, its judgement, its state and the attributes of
`StoppingRule`. The API's schema, the options and help of the command line, the page's form and the
table in docs/stopping.md are generated from it. To add a rule, name its class in the entry point
group `plateau.rules` of an installed distribution; Plateau's own are installed in the same way.

This module lies below `plateau.farm` and `plateau.metric`, which do not import each other, and
imports no numerics.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from enum import Enum
from functools import cache
from types import MappingProxyType
from typing import ClassVar, Final, TypeVar

from plateau.bounds import bounded, require_bounds
from plateau.extensions import offered

#: The entry point group of rules.
GROUP: Final = "plateau.rules"
#: The rule of a job that names none.
DEFAULT: Final = "jod"
#: The rule that computes the curve of every job, whichever rule ends it.
CURVE: Final = "reverse"
#: The rule to whose target the noise left is forecast where no rule of the job has one.
NOISE: Final = "visible"

#: The highest spp that a job or a rule may have.
MOST_SPP: Final = 1_000_000
#: The paper's image size, for which its thresholds and slopes in pixels hold.
PAPER_PIXELS: Final = 512 * 512
#: Rules that wait for little noise, or for a quality, end no job at an earlier evaluation.
_EVALUATIONS_BEFORE_AN_END: Final = 2

_Number = TypeVar("_Number", int, float)


class ParameterRole(str, Enum):
    """What a parameter means to plans, forecasts, plots and texts."""

    #: The rule stops at this many spp, whatever the image looks like.
    END_SPP = "end_spp"
    #: The rule does not stop before this many spp.
    LEAST_SPP = "least_spp"
    #: The rule stops when the noise left is at most this share of the pixels.
    NOISE_TARGET = "noise_target"
    #: The rule stops when its value has reached this.
    VALUE_TARGET = "value_target"
    #: The rule stops when the curve rises by at most this, in changed pixels per spp at 512×512.
    SLOPE = "slope"
    #: How many points of the curve that slope is taken over.
    WINDOW = "window"


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """A parameter of a rule: a number between two bounds; an int if the default is one."""

    default: float
    least: float
    most: float
    description: str  #: what it means, for the API's schema and the command line
    label: str  #: what a form calls it
    help: str  #: a sentence below its field in a form
    unit: str = ""  #: what a form shows behind its field
    scale: float = 1  #: a form shows the value divided by this, such as 0.01 for percent
    role: ParameterRole | None = None
    option: bool = False  #: whether the command line has an option of its name

    @property
    def is_whole(self) -> bool:
        """Whether only whole numbers are allowed."""
        return isinstance(self.default, int)


def parameter(
    default: _Number,
    least: _Number,
    most: _Number,
    *,
    description: str,
    label: str,
    help: str,  # noqa: A002
    unit: str = "",
    scale: float = 1,
    role: ParameterRole | None = None,
    option: bool = False,
) -> _Number:
    """Return the field of a rule that this `Parameter` describes."""
    about = Parameter(**locals())
    return bounded(default, least, most, parameter=about)


def least_spp(guards_against: str) -> int:
    """Return the field of the samples per pixel before which a rule does not stop."""
    return parameter(
        200,
        1,
        MOST_SPP,
        description="fewest samples per pixel at which the rule may stop",
        label="Not before",
        unit="spp",
        help=guards_against,
        role=ParameterRole.LEAST_SPP,
    )


@dataclass(frozen=True)
class SlopeLimit:
    """A slope of the curve at which a rule stops."""

    window: int  #: how many points of the curve the slope is taken over
    at_paper_size: float  #: in changed pixels per spp of an image of 512×512

    def of(self, pixels: int) -> float:
        """Return the slope for an image of this many pixels."""
        return self.at_paper_size * pixels / PAPER_PIXELS


@dataclass(kw_only=True)
class StoppingRule:
    """A rule's description: a dataclass whose fields are its parameters.

    `plateau.metric.rules.base.Rule` adds the judgement and its state.

    Raises
    ------
    ValueError
        If a parameter is out of its bounds.
    """

    #: The name of the rule in a job's spec, and of its entry point.
    name: ClassVar[str]
    #: What a form calls the rule.
    title: ClassVar[str]
    #: When it stops, in a sentence or two: for a form, the API's schema and the shell.
    help: ClassVar[str]
    #: Rules are listed by rising order.
    order: ClassVar[int] = 100
    #: Whether a form offers it among the first.
    featured: ClassVar[bool] = False
    #: Whether any ended job can be continued with it, because it needs no earlier image.
    continues: ClassVar[bool] = False
    #: What its value is and its unit, where a point of the curve does not have that anyway.
    quantity: ClassVar[str] = ""
    unit: ClassVar[str] = ""
    #: Whether that is the quality by ColorVideoVDP: jobs with the rule have a map of it.
    by_quality: ClassVar[bool] = False
    #: Whether that is an error, which falls by powers of ten, as a plot shows it.
    is_error: ClassVar[bool] = False
    #: Whether it needs four independent parts of the slices: of whole frames, as rendered.
    by_quarters: ClassVar[bool] = False
    #: The fewest pixels across and down of an image that it can judge.
    least_side: ClassVar[int] = 1
    #: The spp at which it foresees by itself that its target is reached, by the last image.
    foreseen_spp: int | None = field(default=None, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        require_bounds(self)

    @classmethod
    def parameters(cls) -> dict[str, Parameter]:
        """Return the parameters by name."""
        return {
            one.name: one.metadata["parameter"]
            for one in fields(cls)
            if one.init and "parameter" in one.metadata
        }

    def value_of(self, role: ParameterRole) -> float | None:
        """Return the value of the parameter with this role; None if the rule has none."""
        return next(
            (getattr(self, name) for name, one in self.parameters().items() if one.role is role),
            None,
        )

    @property
    def noise_target(self) -> float | None:
        """The noise left, as a share of the pixels, at which it stops."""
        return self.value_of(ParameterRole.NOISE_TARGET)

    @property
    def value_target(self) -> float | None:
        """The value at which it stops, in its `unit`."""
        return self.value_of(ParameterRole.VALUE_TARGET)

    @property
    def quality_target(self) -> float | None:
        """The quality by ColorVideoVDP at which it stops, in JOD: zones are chosen by it."""
        return self.value_target if self.by_quality else None

    @property
    def slope_limit(self) -> SlopeLimit | None:
        """The slope of the curve at which it stops."""
        window, slope = self.value_of(ParameterRole.WINDOW), self.value_of(ParameterRole.SLOPE)
        return None if window is None or slope is None else SlopeLimit(int(window), slope)

    @property
    def least_spp(self) -> int:
        """The spp before which it does not stop."""
        return int(self.value_of(ParameterRole.LEAST_SPP) or 0)

    def soonest_end_spp(self, step: int) -> int | None:
        """Return the least spp at which it may end a job before any evaluation; None if unknown.

        `step` is the spp between two evaluations.
        """
        if self.noise_target is None and not self.by_quality:
            return self.expected_end_spp(None)
        return max(_EVALUATIONS_BEFORE_AN_END * step, self.least_spp)

    def expected_end_spp(
        self, forecast_spp: int | None, crossing_spp: int | None = None
    ) -> int | None:
        """Return the spp at which it is expected to end a job; None if unknown.

        Parameters
        ----------
        forecast_spp
            Where the noise left is expected to reach the rule's target.
        crossing_spp
            Where the line through the rule's last two values falls to its limit.
        """
        end_spp = self.value_of(ParameterRole.END_SPP)
        if end_spp is not None:
            return int(end_spp)
        expected = self.foreseen_spp or (
            crossing_spp if self.noise_target is None else forecast_spp
        )
        return None if expected is None else max(expected, self.least_spp)


@cache
def rules() -> "Mapping[str, type[StoppingRule]]":
    """Return the installed rules by name, sorted by their `order`.

    Raises
    ------
    ImportError
        A rule cannot be loaded, is no `StoppingRule`, or has the name of another.
    """
    found: dict[str, type[StoppingRule]] = {}
    for entry, rule in offered(GROUP):
        if not (isinstance(rule, type) and issubclass(rule, StoppingRule)):
            raise ImportError(f"the rule {entry.name} ({entry.value}) is no StoppingRule")
        if rule.name != entry.name:
            raise ImportError(f"the rule {entry.name} ({entry.value}) calls itself {rule.name}")
        if found.setdefault(rule.name, rule) is not rule:
            raise ImportError(f"two rules are called {rule.name}; uninstall one of them")
    if not {DEFAULT, CURVE, NOISE} <= found.keys():
        raise ImportError("Plateau's own rules are not installed: install the package again")
    return MappingProxyType(dict(sorted(found.items(), key=lambda one: (one[1].order, one[0]))))


def as_offered() -> "list[type[StoppingRule]]":
    """Return the rules in the order of forms and help: the default first, then the featured."""
    return sorted(rules().values(), key=lambda rule: (rule.name != DEFAULT, not rule.featured))


def create(name: str, **parameters: object) -> StoppingRule:
    """Return a rule of this name; parameters that are not given have their defaults.

    Raises
    ------
    ValueError
        The rule or a parameter does not exist, or a value is out of its bounds.
    """
    if name not in rules():
        raise ValueError(f"there is no rule {name!r}; the rules are {', '.join(sorted(rules()))}")
    rule = rules()[name]
    known = list(rule.parameters())
    for given in parameters:
        if given not in known:
            raise ValueError(
                f"the rule {name!r} has no parameter {given!r}; it has {', '.join(known)}"
            )
    try:
        return rule(**parameters)
    except TypeError as error:
        raise ValueError(f"the rule {name!r}: {error}") from error
