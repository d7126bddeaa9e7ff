"""Checks an uploaded scene with the values of each job that is to render it."""

from typing import BinaryIO

from plateau.farm.bundle import BundleError, SceneSummary
from plateau.farm.model.renderers import variant_for
from plateau.farm.model.spec import BatchSpec, JobSpec
from plateau.service.api.problems import catalogue as problems
from plateau.service.api.problems.problem import Problem
from plateau.service.api.problems.spec_checks import check_film_sizes, check_size
from plateau.service.api.scene_checks.pool import Check
from plateau.service.api.scene_checks.process import CheckBudget
from plateau.service.api.submission.scene_parts import broken_scene


async def checked(check: Check, file: BinaryIO, spec: JobSpec | BatchSpec) -> SceneSummary:
    """Check the file with the values of each entry; returns the summary with the first ones."""
    entries = different(spec)
    asked = [(one.parameter_strings(), one.sensor) for one in entries.values()]
    try:
        found = await check(file, asked)
    except BundleError as error:
        raise broken_scene(error) from error
    if spec.shot is not None:
        check_film_sizes(found.sizes, list(entries))
    if found.summary is not None:
        try:
            summary = found.summary
            variant = variant_for(spec.variant, summary.renderer, is_whole=summary.is_whole)
        except ValueError as error:
            raise Problem(problems.FOREIGN_VARIANT, error=error) from error
    fields = iter(entries)
    for (width, height), entry in zip(found.sizes, entries.values(), strict=False):
        one = entry.model_copy(update={"variant": variant})
        check_size(one, width, height, next(fields) or "spec")
    if found.error is not None:
        raise broken_scene(found.error, next(fields)) from found.error
    if len(found.sizes) < len(asked):
        entries_checked = next(fields).rpartition(".")[2]
        raise Problem(problems.SLOW_TO_CHECK, entries=entries_checked, seconds=CheckBudget.total_s)
    assert found.summary is not None  # a spec has at least one entry
    return found.summary


def different(spec: JobSpec | BatchSpec) -> dict[str, JobSpec]:
    """The spec of each job by the field with its values; of equal ones only the first."""
    if isinstance(spec, JobSpec):
        return {"": spec}
    different: dict[frozenset[tuple[str, str]], tuple[str, JobSpec]] = {}
    for index, one in enumerate(spec.job_specs("checked")):
        values = frozenset(one.parameter_strings().items())
        different.setdefault(values, (f"spec.parameters.{index}", one))
    return dict(different.values())
