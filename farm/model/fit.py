"""The workers that may render a job: those of its pool that have its tags and its variant.

Redis has both sides as text, so that a lease compares strings: see ``farm/redis/lua/waiting.lua``.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from plateau.farm.model.job import Job
from plateau.farm.model.place_names import DEFAULT_POOL
from plateau.farm.model.spec import SharedSpec
from plateau.farm.model.worker import Worker

#: The variant of a job that is not pinned to one yet.
ANY: Final = "auto"


@dataclass(frozen=True)
class Kind:
    """The variants, pool and tags of a worker."""

    variants: tuple[str, ...]  #: best first
    pool: str = DEFAULT_POOL
    tags: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        """The kind as Redis has it."""
        return f"{self.pool} {','.join(self.variants)} {','.join(sorted(self.tags))}"

    @staticmethod
    def read(text: str) -> Kind:
        """The kind of a `text`."""
        pool, variants, tags = text.split(" ")
        return Kind(_names(variants), pool, _names(tags))

    def serves(self, job: Job) -> bool:
        """Whether such a worker may render the job; one that has no variant yet takes any."""
        return self.meets(job.variant or job.spec.variant, job.spec.pool, job.spec.requires)

    def meets(self, variant: str, pool: str, requires: Iterable[str]) -> bool:
        """Whether such a worker may render jobs that need this."""
        return (
            self.pool == pool
            and set(requires) <= set(self.tags)
            and bool(self.variants)
            and (variant == ANY or variant in self.variants)
        )


def _names(text: str) -> tuple[str, ...]:
    return tuple(filter(None, text.split(",")))


def need(spec: SharedSpec) -> str:
    """A job's pool, tags and blocked workers, as Redis has them."""
    blocked = f" !{','.join(spec.blocked)}" if spec.blocked else ""
    return f"{spec.pool} {','.join(spec.requires)}".rstrip() + blocked


def blocked_in(need: str) -> tuple[str, ...]:
    """The blocked workers of a need."""
    return _names(need.partition("!")[2])


def serves(worker: Worker, job: Job) -> bool:
    """Whether the worker takes work, and may render the job."""
    return meets(worker, job.variant or job.spec.variant, need(job.spec))


def meets(worker: Worker, variant: str, need: str) -> bool:
    """Whether the worker takes work, and may render jobs of this variant and this `need`."""
    pool, _, tags = need.partition("!")[0].rstrip().partition(" ")
    return (
        not worker.drained
        and worker.trouble is None
        and not {worker.id, worker.host} & set(blocked_in(need))
        and Kind(worker.variants, worker.pool, worker.tags).meets(variant, pool, _names(tags))
    )


def waits_for(job: Job, kinds: Iterable[Kind], workers: Iterable[Worker] = ()) -> str | None:
    """The worker or the jobs that a job waits for, in words; None if it may be rendered.

    `kinds` are those of the living workers. Where some are blocked for the job, the living
    `workers` themselves count.
    """
    if job.state.value not in {"queued", "rendering"} or job.held:
        return None
    if job.awaits or job.awaits_turn:
        return job.reason
    if job.spec.blocked:
        is_served = any(serves(worker, job) for worker in workers)
    else:
        is_served = any(kind.serves(job) for kind in kinds)
    if is_served:
        return None
    variant = job.variant or job.spec.variant
    wanted = [
        "" if variant == ANY else f"that renders {variant}",
        "" if job.spec.pool == DEFAULT_POOL else f"in pool {job.spec.pool}",
        f"with tags {', '.join(job.spec.requires)}" if job.spec.requires else "",
        "that is not blocked for it" if job.spec.blocked else "",
    ]
    which = " ".join(filter(None, ["a worker", *wanted]))
    return f"waits for {which}: there is none that takes work"
