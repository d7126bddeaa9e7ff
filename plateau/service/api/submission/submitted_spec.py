"""The spec in a request: of one job, or of many if its parameters are a list."""

import json
from typing import Annotated, Any, Final

from pydantic import Discriminator, Tag, TypeAdapter, ValidationError

from plateau.farm.model.input_errors import BRANCHES
from plateau.farm.model.spec import BatchSpec, JobSpec, SharedSpec
from plateau.farm.process.letters import is_visible
from plateau.farm.wire.json_numbers import whole_numbers
from plateau.service.api.problems import catalogue as problems
from plateau.service.api.problems.problem import Problem
from plateau.service.api.problems.spec_checks import invalid_spec

_JOB, _BATCH = BRANCHES


def _kind(spec: Any) -> str:
    entries = spec.get("parameters") if isinstance(spec, dict) else None
    # A list of texts is one job's, each NAME=VALUE.
    one = not isinstance(entries, list) or (entries and all(isinstance(x, str) for x in entries))
    return _JOB if one else _BATCH


_SUBMITTED: Final[TypeAdapter[JobSpec | BatchSpec]] = TypeAdapter(
    Annotated[
        Annotated[JobSpec, Tag(_JOB)] | Annotated[BatchSpec, Tag(_BATCH)], Discriminator(_kind)
    ]
)


def submitted_spec(text: str | bytes) -> JobSpec | BatchSpec:
    """Parse and validate the spec; raises the problem with it."""
    try:
        spec = _SUBMITTED.validate_json(_plain(text), strict=True)
    except ValidationError as error:
        raise invalid_spec(error) from error
    check_names(spec)
    check_alone(spec)
    return spec


def _plain(text: str | bytes) -> str | bytes:
    """The same JSON with 1.0 as 1; invalid JSON is returned unchanged."""
    try:
        return json.dumps(whole_numbers(json.loads(text)))
    except (ValueError, RecursionError):
        return text


def check_alone(spec: JobSpec | BatchSpec) -> None:
    """Refuse a shot of one job."""
    if isinstance(spec, JobSpec) and spec.shot is not None:
        raise Problem(problems.SHOT_OF_ONE)


def check_names(spec: SharedSpec) -> None:
    """Refuse names that nobody can read, and a batch whose name cannot be in a path."""
    for field, name in (("name", spec.name or ""), ("batch", spec.batch or "")):
        if not all(map(is_visible, name)):
            raise Problem(problems.INVISIBLE_NAME, field=field)
    if spec.batch in {".", ".."}:
        raise Problem(problems.DOTTED_BATCH)
