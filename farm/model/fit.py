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
        variant = job.variant or job.spec.variant
        return (
            self.pool == job.spec.pool
            and set(job.spec.requires) <= set(self.tags)
            and bool(self.variants)
            and (variant == ANY or variant in self.variants)
        )


def _names(text: str) -> tuple[str, ...]:
    return tuple(filter(None, text.split(",")))


def need(spec: SharedSpec) -> str:
    """A job's pool and tags, as Redis has them."""
    return f"{spec.pool} {','.join(spec.requires)}".rstrip()


def waits_for(job: Job, kinds: Iterable[Kind]) -> str | None:
    """The worker that the job waits for, in words; None if one of these kinds may render it."""
    if job.state.value not in {"queued", "rendering"} or job.held:
        return None
    if any(kind.serves(job) for kind in kinds):
        return None
    variant = job.variant or job.spec.variant
    wanted = [
        "" if variant == ANY else f"that renders {variant}",
        "" if job.spec.pool == DEFAULT_POOL else f"in pool {job.spec.pool}",
        f"with tags {', '.join(job.spec.requires)}" if job.spec.requires else "",
    ]
    which = " ".join(filter(None, ["a worker", *wanted]))
    return f"waits for {which}: there is none that takes work"
