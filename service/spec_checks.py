"""What is wrong with a spec, as problems that name its fields."""

from typing import Final

from pydantic import ValidationError

from farm.seeds import SeedsExhausted
from farm.spec import JobSpec, SharedSpec
from service import problems
from service.problems import FieldError, Problem
from service.webhook_addresses import ReceiverRefused, Receivers

#: What a check of a submitted spec calls its two branches: no field is called so.
BRANCHES: Final = ("one job", "many jobs")

#: So many wrong fields are named: a list of parameters may have thousands.
_MOST_ERRORS: Final = 50


def invalid_spec(error: ValidationError) -> Problem:
    """The problem with a spec that did not pass its validation."""
    errors = [
        FieldError(field=_field(one["loc"]), message=_message(one["type"], one["msg"]))
        for one in error.errors(include_url=False, include_context=False)[:_MOST_ERRORS]
    ]
    return Problem(
        problems.INVALID_SPEC,
        "; ".join(f"{one.field}: {one.message}" for one in errors),
        errors=[one.model_dump() for one in errors],
    )


def _field(location: tuple[int | str, ...]) -> str:
    """The field as the user wrote it: without the branches that the check tried."""
    names = [str(part) for part in location if part not in BRANCHES]
    if names[:1] == ["parameters"]:
        # One job's by name; of a list the entry, and in it the name.
        names = names[: 3 if any(isinstance(part, int) for part in location) else 2]
    if names[:1] == ["rule"]:
        names = names[:1] + names[2:]
    if names[:1] == ["watch"]:
        names = names[:2] + names[3:]
    return ".".join(["spec", *names])


def _message(kind: str, message: str) -> str:
    if kind == "extra_forbidden":
        return "there is no such field; /docs lists those there are"
    return message.removeprefix("Value error, ")


def invalid_field(kind: problems.ProblemType, field: str, message: str) -> Problem:
    """The problem with one field of a request."""
    return Problem(kind, f"{field}: {message}", errors=[{"field": field, "message": message}])


def check_seeds(spec: JobSpec, width: int, height: int, field: str = "spec") -> None:
    """Refuse a job that would run out of distinct sampler seeds on any worker that may take it."""
    try:
        # Of the variants that a worker may choose, JIT ones have the most seeds.
        variant = "llvm_ad_rgb" if spec.variant == "auto" else spec.variant
        spec.seed_schedule(variant, width, height)
    except SeedsExhausted as error:
        raise invalid_field(problems.INVALID_SPEC, field, str(error)) from error


def check_webhook(spec: SharedSpec, receivers: Receivers) -> None:
    """Refuse a webhook to where the farm would send nothing."""
    if spec.webhook is None:
        return
    try:
        receivers.check(spec.webhook.url)
    except ReceiverRefused as refused:
        raise invalid_field(problems.INVALID_SPEC, "spec.webhook.url", str(refused)) from refused
