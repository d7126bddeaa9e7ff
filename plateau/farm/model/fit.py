"""The workers that may render a job: those of its pool that have its tags and its variant.

Redis has both sides as text, so that a lease compares strings: see
``plateau/farm/redis/lua/waiting.lua``.
"""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

from plateau.farm.model.job import Job
from plateau.farm.model.place_names import DEFAULT_POOL
from plateau.farm.model.renderers import AUTO
from plateau.farm.model.spec import SharedSpec
from plateau.farm.model.worker import Worker


@dataclass(frozen=True)
class WorkerClass:
    """The variants, pool and tags of a worker."""

    variants: tuple[str, ...]  #: best first
    pool: str = DEFAULT_POOL
    tags: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        """The class as Redis has it."""
        return f"{self.pool} {','.join(self.variants)} {','.join(sorted(self.tags))}"

    def serves(self, wanted: str) -> bool:
        """Whether such a worker may render jobs of this class: "VARIANT POOL TAG,TAG"."""
        variant, pool, tags = parts_of(wanted)
        return (
            self.pool == pool
            and tags <= set(self.tags)
            and bool(self.variants)
            and (variant == AUTO or variant in self.variants)
        )


def need(spec: SharedSpec) -> str:
    """A job's pool and tags, as Redis has them."""
    return f"{spec.pool} {','.join(spec.requires)}".rstrip()


def class_of(job: Job) -> str:
    """The class of a job, as Redis has it; a job without a variant takes any."""
    return f"{job.variant or job.spec.variant} {need(job.spec)}"


def parts_of(wanted: str) -> tuple[str, str, set[str]]:
    """The variant, pool and tags of a class of jobs."""
    variant, pool, *tags = wanted.split(" ")
    return variant, pool, set(tags[0].split(",")) if tags else set()


class Crew:
    """The living workers that take work."""

    def __init__(self, workers: Iterable[Worker]) -> None:
        self._workers = [
            worker for worker in workers if not worker.drained and worker.trouble is None
        ]
        self._classes = Counter(map(class_of_worker, self._workers))

    def fitting(self, job: Job) -> int:
        """How many of them may render the job."""
        wanted = class_of(job)
        every = sum(count for one, count in self._classes.items() if one.serves(wanted))
        return every - self.left_out(job)

    def left_out(self, job: Job) -> int:
        """How many others could, but are left out of it for a while."""
        wanted = class_of(job)
        return sum(
            job.id in worker.left_out_of and class_of_worker(worker).serves(wanted)
            for worker in self._workers
        )


def class_of_worker(worker: Worker) -> WorkerClass:
    """What the worker may render, by its description."""
    return WorkerClass(worker.variants, worker.pool, worker.tags)


def waits_for(job: Job, crew: Crew) -> str | None:
    """The worker or the jobs that a job waits for, in words; None if it may be rendered."""
    if job.state.value not in {"queued", "rendering"} or job.held:
        return None
    if job.awaits:
        return job.reason
    if crew.fitting(job):
        return None
    variant = job.variant or job.spec.variant
    wanted = [
        "" if variant == AUTO else f"that renders {variant}",
        "" if job.spec.pool == DEFAULT_POOL else f"in pool {job.spec.pool}",
        f"with tags {', '.join(job.spec.requires)}" if job.spec.requires else "",
        "that is not left out of it" if crew.left_out(job) else "",
    ]
    which = " ".join(filter(None, ["a worker", *wanted]))
    return f"waits for {which}: there is none that takes work"
