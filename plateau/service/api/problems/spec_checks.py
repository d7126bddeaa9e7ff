"""Problems with a spec or a request, by field."""

from collections.abc import Sequence
from typing import Any, Final, TypeVar

from pydantic import ValidationError

from plateau.farm.model import input_errors
from plateau.farm.model.seeds import SeedsExhausted
from plateau.farm.model.spec import JobSpec, SharedSpec
from plateau.farm.model.spec.parts import LEAST_SIDE
from plateau.farm.model.spec.shared import UnfitFilm
from plateau.service.api.problems import catalogue as problems
from plateau.service.api.problems.problem import FieldError, Problem, ProblemType
from plateau.service.notices.receivers import ReceiverRefused, Receivers
from plateau.service.notices.targets import Targets, UnknownTarget

AnySpec = TypeVar("AnySpec", bound=SharedSpec)

#: The most wrong fields that a problem names; a list of parameters may have thousands.
_MOST_ERRORS: Final = 50


def invalid_spec(error: ValidationError) -> Problem:
    """The problem with a spec that failed its validation."""
    return _invalid(problems.INVALID_SPEC, error.errors(include_url=False), ("spec",))


def invalid_request(errors: Sequence[Any]) -> Problem:
    """The problem with a request's path, query or body, by Pydantic's details."""
    return _invalid(problems.INVALID_REQUEST, errors, ())


def _invalid(kind: ProblemType, details: Sequence[Any], within: tuple[str, ...]) -> Problem:
    located: list[tuple[tuple[int | str, ...], Any]] = []
    for one in details:
        # A request's location starts with its place: path, query or body.
        location = one["loc"] if within else one["loc"][1:] or one["loc"]
        if not within and one["loc"][0] == "query":
            if one["type"] == "none_required":  # of an optional one, and no query has a null
                continue
            # A query has lists and no objects: other names are those of types.
            location = (*location[:1], *(part for part in location[1:] if isinstance(part, int)))
        located.append((location, one))
    errors = [
        FieldError(field=".".join(filter(None, (*within, field))), message=message)
        for field, message in list(input_errors.by_field(located).items())[:_MOST_ERRORS]
    ]
    said = "; ".join(f"{one.field}: {one.message}" for one in errors)
    return Problem(kind, said=said, errors=[one.model_dump() for one in errors])


def check_size(spec: JobSpec, width: int | None, height: int | None, field: str = "spec") -> None:
    """Refuse a job that no worker has enough seeds for, or whose rule cannot judge the image."""
    try:
        if width and height:
            spec.require_size(width, height)
        # Of the variants that `auto` may become, the JIT ones have the most seeds.
        variant = "llvm_ad_rgb" if spec.variant == "auto" else spec.variant
        # Where the size is not known, the seeds do not depend on it.
        spec.seed_schedule(variant, width or 1, height or 1)
    except (UnfitFilm, SeedsExhausted) as error:
        raise Problem(problems.UNFIT_FILM, field=field, error=error) from error


def check_film_sizes(sizes: Sequence[tuple[int | None, int | None]], fields: Sequence[str]) -> None:
    """Refuse a shot whose films differ in size, or are too small; `fields` name the frames."""
    for size, field in zip(sizes, fields, strict=False):
        width, height = size
        if width is None or height is None:
            raise Problem(problems.SIZE_UNKNOWN, field=field)
        film = {"field": field, "width": width, "height": height}
        if min(width, height) < LEAST_SIDE:
            raise Problem(problems.SMALL_FRAME, least=LEAST_SIDE, **film)
        if size != sizes[0]:
            raise Problem(
                problems.SIZES_DIFFER,
                first=fields[0],
                first_width=sizes[0][0],
                first_height=sizes[0][1],
                **film,
            )


def with_notice(spec: AnySpec, receivers: Receivers, targets: Targets) -> AnySpec:
    """The spec with the targets that hear of every job; refuses a notice that cannot be sent."""
    notice = spec.notice
    if notice.is_hidden:
        raise Problem(problems.HIDDEN_URL)
    if notice.url is not None:
        try:
            receivers.check(notice.url)
        except ReceiverRefused as refused:
            raise Problem(problems.REFUSED_URL, error=refused) from refused
        if notice.secret is None:
            raise Problem(problems.NO_SECRET)
    try:
        names = targets.with_always(notice.targets)
    except UnknownTarget as unknown:
        raise Problem(problems.UNKNOWN_NOTICE_TARGET, error=unknown) from unknown
    return spec.model_copy(update={"notice": notice.model_copy(update={"targets": names})})
