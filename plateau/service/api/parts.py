"""What the routes work with, handed to the app when it is made."""

import re
from dataclasses import dataclass
from typing import Annotated, Final

from fastapi import Depends, Request

from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.batches import Batches
from plateau.farm.ledger.continuation import Continuations
from plateau.farm.ledger.deletions import Deletions
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.scene_index import SceneIndex
from plateau.farm.ledger.workers import Workers
from plateau.farm.model.errors import JobNotFound
from plateau.farm.model.job import Job
from plateau.farm.redis.client import RedisClient
from plateau.service.api.event_hub import EventHub
from plateau.service.api.scene_checks.placing import Placing
from plateau.service.api.scene_checks.pool import SceneChecks
from plateau.service.api.stored_files import StoredFiles
from plateau.service.notices.receivers import Receivers
from plateau.service.notices.targets import Targets

_JOB_ID: Final = re.compile(r"[0-9a-f]{12}")


@dataclass(frozen=True)
class Parts:
    """Redis by subject, the blob store, and what the routes build on them."""

    redis: RedisClient
    jobs: Jobs
    scenes: SceneIndex
    batches: Batches
    deletions: Deletions
    continuations: Continuations
    blobs: Blobs
    files: StoredFiles
    checks: SceneChecks
    placing: Placing  #: scenes where they lie
    hub: EventHub
    workers: Workers
    receivers: Receivers  #: of notices
    targets: Targets

    def job(self, job_id: str) -> Job:
        """The job, or `JobNotFound`; Redis is not asked for what cannot be an id."""
        if not _JOB_ID.fullmatch(job_id):
            raise JobNotFound(job_id)
        return self.jobs.get(job_id)


def parts_of(request: Request) -> Parts:
    """The parts of the app that serves the request."""
    found: Parts = request.app.state.parts
    return found


async def _parts(request: Request) -> Parts:
    # A coroutine: FastAPI would run a plain function in a thread.
    return parts_of(request)


#: The parts of the app, as a route takes them.
Farm = Annotated[Parts, Depends(_parts)]
