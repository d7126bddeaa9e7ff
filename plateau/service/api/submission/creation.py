"""Makes the jobs of a submission whose scene is stored."""

import hashlib
import re
import secrets
from collections.abc import Iterable, Iterator
from typing import Final

from plateau.farm.ledger.jobs import Created
from plateau.farm.model.place_names import MOST_TAGS
from plateau.farm.model.renderers import variant_for
from plateau.farm.model.scene_roots import root_tag
from plateau.farm.model.spec import BatchSpec, JobSpec
from plateau.service.api.parts import Parts
from plateau.service.api.problems import catalogue as problems
from plateau.service.api.problems.problem import Problem
from plateau.service.api.submission.reading import Submission
from plateau.service.api.submission.storing import StoredScene

#: What a scene's name ends with and a job's does not.
_SUFFIX: Final = re.compile(r"\.(zip|xml|json)$", re.IGNORECASE)


def create_job(asked: Submission, scene: StoredScene, farm: Parts, *, owner: str) -> Created:
    """Create the job, or the jobs of a list: all of them or none.

    The scene is stored before, so that no worker finds a job without one.
    """
    sha256, called = scene.sha256, _SUFFIX.sub("", scene.name) or scene.name
    source = sha256 if asked.again is None else asked.again.of
    digest = hashlib.sha256(f"{source} {asked.spec.as_request()}".encode()).hexdigest()
    summary = scene.summary
    variant = variant_for(asked.spec.variant, summary.renderer, is_whole=summary.is_whole)
    requires = required(asked.spec, map(root_tag, summary.roots))
    specs = _job_specs(asked.spec, called)
    update = {"variant": variant, "requires": requires}
    return farm.jobs.create(
        *(one.model_copy(update=update) for one in specs),
        name=asked.spec.name or called,
        scene_sha256=sha256,
        idempotency_key=asked.idempotency_key,
        digest=digest,
        owner=owner,
        notes=(*asked.notes, *_which_sensor(asked.spec, scene.summary.sensors)),
        again=asked.again,
    )


def required(spec: JobSpec | BatchSpec, of_roots: Iterable[str]) -> tuple[str, ...]:
    """The tags that workers must have: those of the spec, and those of the scene's roots."""
    tags = {*spec.requires, *of_roots}
    if len(tags) > MOST_TAGS:
        raise Problem(problems.TOO_MANY_TAGS, tags=len(tags), most=MOST_TAGS)
    return tuple(sorted(tags))


def _which_sensor(spec: JobSpec | BatchSpec, sensors: int) -> Iterator[str]:
    """The note on a choice that nobody made."""
    if sensors > 1 and spec.sensor == 0:
        yield (
            f"the scene has {sensors} sensors, and the first is rendered, sensor 0: `sensor` "
            f"(--sensor) chooses another, up to {sensors - 1}"
        )


def _job_specs(spec: JobSpec | BatchSpec, scene: str) -> list[JobSpec]:
    """The spec of each job; those of a list in the batch that it names, or in a generated one."""
    if isinstance(spec, JobSpec):
        return [spec]
    return spec.job_specs(spec.batch or f"{scene}-{secrets.token_hex(4)}")
