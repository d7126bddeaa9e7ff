"""What the routes work with, handed to the app when it is made."""

import re
from dataclasses import dataclass
from typing import Final

from fastapi import Request

from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.batches import Batches
from plateau.farm.ledger.continuation import Continuations
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.outbox import Outbox
from plateau.farm.ledger.scene_index import SceneIndex
from plateau.farm.ledger.workers import Workers
from plateau.farm.model.errors import JobNotFound
from plateau.farm.model.job import Job
from plateau.farm.process.addresses import Receivers
from plateau.service.api.events.hub import EventHub
from plateau.service.api.points.images import PointImages
from plateau.service.api.points.stored_files import StoredFiles
from plateau.service.api.scene_checks.pool import SceneChecks

_JOB_ID: Final = re.compile(r"[0-9a-f]{12}")


@dataclass(frozen=True)
class Parts:
    """The queue, the blob store, and the checks of what comes in."""

    jobs: Jobs
    scenes: SceneIndex
    batches: Batches
    continuations: Continuations
    blobs: Blobs
    files: StoredFiles
    points: PointImages
    checks: SceneChecks
    hub: EventHub
    outbox: Outbox
    workers: Workers
    receivers: Receivers  #: of webhooks

    def job(self, job_id: str) -> Job:
        """The job, or `JobNotFound`; what cannot be an id is not looked up."""
        if not _JOB_ID.fullmatch(job_id):
            raise JobNotFound(job_id)
        return self.jobs.get(job_id)


def parts_of(request: Request) -> Parts:
    """The parts of the app that serves the request."""
    found: Parts = request.app.state.parts
    return found


async def parts(request: Request) -> Parts:
    """As `parts_of`, as a route takes them: no function, for which FastAPI would fetch a thread."""
    return parts_of(request)
