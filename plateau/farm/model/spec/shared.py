"""How an image is sampled, judged and stopped, whatever the parameters of its scene are."""

import json
from itertools import pairwise
from typing import Annotated, Any, Final, Literal, TypeVar

from pydantic import AfterValidator, Field, model_validator
from pydantic_core import PydanticKnownError

from plateau.farm.model import renderers
from plateau.farm.model.aovs import AOV_NAMES, GUIDED_SPP, GUIDES, AovName
from plateau.farm.model.place_names import DEFAULT_POOL, PlaceName, Tags
from plateau.farm.model.seeds import JOB_SEEDS
from plateau.farm.model.spec import texts
from plateau.farm.model.spec.notice import NoticeSpec
from plateau.farm.model.spec.parts import (
    AllocationSpec,
    AutoAllocation,
    DenoiseSpec,
    ExrSpec,
    FrameAllocation,
    FramesBecause,
    NoDenoising,
    OidnDenoising,
    ShotSpec,
    ZonesAllocation,
)
from plateau.farm.model.spec.rule_model import Strict
from plateau.farm.model.spec.rule_specs import JodSpec, ReverseSpec, RuleSpec
from plateau.farm.model.spec.view import DENSITIES, FROM_PLACE, ViewSpec
from plateau.rules import CURVE, MOST_SPP

#: Noisy images that image.exr may have beside its own.
MOST_INPUTS: Final = 16

Priority = Annotated[int, Field(ge=-1000, le=1000)]

_Spec = TypeVar("_Spec", bound="SharedSpec")


def _known_variant(name: str, *more: str) -> str:
    """Return a variant's stored and shown name, or one of `more`."""
    shown, known = renderers.shown_name(name), [*more, *renderers.variants()]
    if shown in known:
        return shown
    *others, last = map(repr, known)
    raise PydanticKnownError("literal_error", {"expected": f"{', '.join(others)} or {last}"})


def _list_variants(schema: dict[str, Any], *more: str) -> None:
    schema["enum"] = [*more, *renderers.variants()]


#: A variant of an installed renderer, by its stored and shown name.
RenderVariant = Annotated[
    str, AfterValidator(_known_variant), Field(json_schema_extra=_list_variants)
]
#: One that a job may ask for.
Variant = Annotated[
    str,
    AfterValidator(lambda name: _known_variant(name, renderers.AUTO)),
    Field(json_schema_extra=lambda schema: _list_variants(schema, renderers.AUTO)),
]

#: The longest time limit: a year.
MOST_S: Final = 366 * 86_400


def _each_once(names: tuple[AovName, ...]) -> tuple[AovName, ...]:
    if len(set(names)) < len(names):
        raise ValueError("each AOV may be named once")
    return names


Aovs = Annotated[tuple[AovName, ...], texts.LIST, AfterValidator(_each_once)]

#: The most jobs and batches that a job waits for.
MOST_AFTER: Final = 16

After = Annotated[
    tuple[Annotated[str, Field(min_length=1, max_length=100)], ...],
    Field(max_length=MOST_AFTER),
    AfterValidator(lambda names: tuple(dict.fromkeys(names))),
]

#: Samples per pixel.
Spp = Annotated[int, Field(ge=1, le=MOST_SPP)]


def _may_render_zones(variant: str) -> bool:
    return variant == renderers.AUTO or renderers.variant_named(variant).renders_zones


class UnfitFilm(ValueError):
    """A rule of the job cannot judge an image of this size, under the job's view."""


class SharedSpec(Strict):
    """How an image is sampled, judged and stopped, whatever the scene's parameters are."""

    name: Annotated[str, Field(min_length=1, max_length=100)] | None = Field(
        default=None, description="what the job is called; by default as its scene is"
    )
    step: Spp = Field(
        default=100,
        description="spp between two evaluations of the rule; where it, the cap and the slices are "
        "no multiples of each other, they are changed a little, and a note on the job says so",
    )
    slice_spp: int = Field(
        default=25, ge=1, le=4096, description="spp of one slice, the unit of work"
    )
    max_spp: Spp = Field(default=10_000, description="cap: the job ends there")
    time_limit_s: float | None = Field(
        default=None,
        ge=0.1,
        le=MOST_S,
        description="seconds, pauses not counted, after which the job ends; "
        "`time_limit_from` says where they begin",
    )
    time_limit_from: Literal["first_slice", "submission"] = Field(
        default="first_slice",
        description="where the time limit begins: at the first slice, so that waiting for a worker "
        "does not count, or at the submission; a job without a slice by then fails",
    )
    min_spp: Spp | None = Field(
        default=None,
        description="whatever the rule says, not converged before so many samples per pixel; the "
        "rule visible has a min_spp of its own, and the greater of the two counts",
    )
    priority: Priority = Field(default=0, description="higher is served first")
    batch: str | None = Field(
        default=None, min_length=1, max_length=100, description="a name that groups jobs"
    )
    shot: Annotated[ShotSpec | None, texts.SHOT] = Field(
        default=None,
        description="the batch is a shot, whose frames are judged as a video too: `parameters` is "
        "a list with an entry for each frame, in their order",
    )
    variant: Variant = Field(
        default="auto",
        description="a renderer's variant, such as llvm_ad_rgb (also as mitsuba:llvm_ad_rgb); auto "
        "takes the best of the first worker",
    )
    pool: PlaceName = Field(default=DEFAULT_POOL, description="only workers of this pool render it")
    requires: Tags = Field(
        default=(), description="only workers that have all of these tags render it"
    )
    after: After = Field(
        default=(),
        description="ids of jobs and names of batches: it waits until all of them, a batch with "
        "the jobs that it has now, have converged or reached their limits, and their results "
        "are written; if one fails or is cancelled, it is cancelled too",
    )
    seed: int = Field(
        default=0,
        ge=0,
        le=JOB_SEEDS - 1,
        description="another seed draws samples independent of all others",
    )
    sensor: int = Field(default=0, ge=0, le=1000, description="index of the scene's sensor")
    aovs: Aovs = Field(
        default=(),
        max_length=len(AOV_NAMES),
        description="what image.exr has besides colour, such as albedo, normal or depth",
    )
    exr: ExrSpec = Field(default_factory=ExrSpec, description="how image.exr is written")
    rule: Annotated[RuleSpec, texts.NAMED] = Field(
        default_factory=JodSpec, description="the rule that ends the job"
    )
    allocation: Annotated[AllocationSpec, texts.NAMED] = Field(
        default_factory=AutoAllocation,
        description="where samples go: all over the frame, or to the zones in which more is left "
        "to see. A job whose first slice is being rendered shows what `auto` became",
    )
    denoise: Annotated[DenoiseSpec, texts.NAMED] = Field(
        default_factory=NoDenoising,
        description="whether the image that is judged and delivered is denoised; its curve then "
        "has points at growing distances",
    )
    watch: Annotated[tuple[Annotated[RuleSpec, texts.NAMED], ...], texts.LIST] = Field(
        default=(ReverseSpec(),),
        max_length=16,
        description="rules that are evaluated and reported, and stop nothing; by default `reverse` "
        "(Takouachet's), unless it ends the job or the image is denoised",
    )
    view: Annotated[ViewSpec, FROM_PLACE] = Field(
        default_factory=ViewSpec, description="how the image is viewed"
    )
    keep_slices: bool = Field(
        default=False, description="keep every slice, to be judged again by other rules and views"
    )
    inputs: Annotated[tuple[Annotated[int, Field(ge=1, le=4096)], ...], texts.LIST] = Field(
        default=(),
        max_length=MOST_INPUTS,
        description="samples per pixel, rising, of noisy images that image.exr has as layers "
        "`spp0004.R` and so on, with all channels: sums of the first passes, at most of a slice",
    )
    variance: bool = Field(
        default=False,
        description="whether image.exr has `variance.R`, `variance.G` and `variance.B`: the "
        "variance of each value against the converged image, without bias, from four parts of the "
        "slices",
    )
    pictures: bool = Field(
        default=True,
        description="whether there is anything for people to look at beside image.exr: previews, "
        "image.png and maps. A data set has no need of them",
    )
    notice: NoticeSpec = Field(
        default_factory=NoticeSpec, description="who is notified when the job ends"
    )

    @model_validator(mode="after")
    def _consistent(self) -> "SharedSpec":
        if "watch" not in self.model_fields_set and (self.rule.name == CURVE or self.is_denoised):
            # The paper's rule compares images in equal steps, which denoised ones have not.
            self.__dict__["watch"] = ()
        if self.min_spp is not None and self.min_spp > self.max_spp:
            raise ValueError(
                f"min_spp must not be above max_spp: {self.min_spp} is above {self.max_spp}"
            )
        if isinstance(self.allocation, ZonesAllocation):
            self._check_zones()
        if self.by_quarters and (self.by_zones or self.is_denoised):
            raise ValueError(
                "the error of an image is known where it has whole frames, as rendered: choose the "
                "allocation frame and no denoiser, or neither variance nor a rule by the error"
            )
        self._check_inputs()
        names = [rule.name for rule in (self.rule, *self.watch)]
        if len(set(names)) < len(names):
            raise ValueError("each rule may be named once, as the rule or under watch")
        return self

    def _check_inputs(self) -> None:
        if any(one >= after for one, after in pairwise(self.inputs)):
            raise ValueError(f"inputs must rise: they are {', '.join(map(str, self.inputs))}")
        if self.inputs and self.inputs[-1] > self.slice_spp:
            raise ValueError(
                f"inputs lie in the first slice: {self.inputs[-1]} is above slice_spp, "
                f"{self.slice_spp}; raise slice_spp"
            )
        if self.inputs and (self.by_zones or self.is_denoised):
            raise ValueError(
                "inputs are whole frames, as rendered: choose the allocation frame and no denoiser"
            )

    def _check_zones(self) -> None:
        if not _may_render_zones(self.variant):
            raise ValueError(
                f"{self.variant} renders whole films alone: choose the allocation frame, or "
                "another variant"
            )
        if self.shot is not None:
            raise ValueError(
                "zones have samples where a still shows noise, and not where a shot does: choose "
                "the allocation frame, or no shot"
            )

    @property
    def by_zones(self) -> bool:
        """Whether its samples are allocated by zones; of `auto`, whether they may be."""
        if isinstance(self.allocation, AutoAllocation):
            return self.frames_because(self.variant) is None
        return isinstance(self.allocation, ZonesAllocation)

    def frames_because(self, variant: str) -> FramesBecause | None:
        """Why `auto` is the frame on this variant; None where it is zones.

        Only by the quality zones lose nothing. Kept slices may be compared frame by frame, or
        judged with another step. A GPU waits for the judgements of zones longer than it would
        render their samples. The variant `auto` may have zones: its first worker decides.
        """
        if self.rule.behaviour.quality_target is None:
            return "rule"
        if self.by_quarters:
            return "variance" if self.variance else "rule"
        if self.inputs:
            return "inputs"
        if self.shot is not None:
            return "shot"
        if self.keep_slices:
            return "keep_slices"
        if not _may_render_zones(variant):
            return "variant"
        is_on_gpu = variant != renderers.AUTO and renderers.variant_named(variant).on_gpu
        return "gpu" if is_on_gpu else None

    def settled(self: _Spec, variant: str) -> _Spec:
        """The spec on this variant: what `auto` is there takes its place."""
        if not isinstance(self.allocation, AutoAllocation):
            return self
        is_frame = self.frames_because(variant) is not None
        settled = FrameAllocation() if is_frame else ZonesAllocation()
        return self.model_copy(update={"allocation": settled})

    @property
    def is_denoised(self) -> bool:
        """Whether the image that it judges and delivers is denoised."""
        return self.denoise.name != "none"

    @property
    def is_guided(self) -> bool:
        """Whether albedo and normal guide the denoiser."""
        return isinstance(self.denoise, OidnDenoising) and self.denoise.guides

    def slice_aovs(self, index: int) -> tuple[AovName, ...]:
        """Return the AOVs of a slice's film: the guides are in the first slices alone."""
        has_guides = self.is_guided and index * self.slice_spp < GUIDED_SPP
        asked = {*self.aovs, *(GUIDES if has_guides else ())}
        return tuple(name for name in AOV_NAMES if name in asked)

    @property
    def noise_target(self) -> float | None:
        """The noise left, as a share of the pixels, for which the first of its rules waits."""
        targets = (one.behaviour.noise_target for one in (self.rule, *self.watch))
        return next((target for target in targets if target is not None), None)

    @property
    def by_quality(self) -> bool:
        """Whether one of its rules goes by the quality by ColorVideoVDP."""
        return any(one.behaviour.by_quality for one in (self.rule, *self.watch))

    @property
    def by_quarters(self) -> bool:
        """Whether one of its rules, or its variance, needs four parts of the slices."""
        return self.variance or any(one.behaviour.by_quarters for one in (self.rule, *self.watch))

    def require_size(self, width: int, height: int) -> None:
        """Raise `UnfitFilm` where its rules cannot judge an image of this size, or so seen."""
        for rule in (self.rule, *self.watch):
            least = rule.behaviour.least_side
            if min(width, height) < least:
                raise UnfitFilm(
                    f"the rule {rule.name} judges images of {least}×{least} pixels or more, and "
                    f"this one has {width}×{height}: make the film larger, or name another rule, "
                    "such as visible"
                )
        density = self.view.density(width)
        coarsest, finest = DENSITIES
        if self.by_quality and not coarsest <= density <= finest:
            raise UnfitFilm(
                f"an image {width} pixels wide that fills {self.view.field_of_view_deg:g}° has "
                f"{density:,.3g} pixels in a degree, and the model of vision behind jod knows "
                f"{coarsest:g} to {finest:,g}: change field_of_view_deg, or give pixels_per_degree"
            )

    def as_request(self) -> str:
        """The spec as JSON, the notice's secret included: never to be stored, nor shown.

        What has its default is left out, so that an older service is told of no field that it does
        not know.
        """
        asked = {
            name
            for name, field in type(self).model_fields.items()
            if getattr(self, name) != field.get_default(call_default_factory=True)
        }
        document = self.model_dump(mode="json", include=asked)
        if "notice" in document:
            document["notice"] = self.notice.as_request()
        return json.dumps(document)
