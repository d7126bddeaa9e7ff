"""What the routes work with, handed to the app when it is made."""

import re
from dataclasses import dataclass
from typing import Final

from fastapi import Request

from farm.batches import Batches
from farm.blobs import Blobs
from farm.continuation import Continuations
from farm.errors import JobNotFound
from farm.job import Job
from farm.jobs import Jobs
from farm.scene_index import SceneIndex
from farm.studies import Studies
from farm.webhooks import Outbox
from farm.workers import Workers
from service.event_hub import EventHub
from service.point_images import PointImages
from service.scene_checks import SceneChecks
from service.stored_files import StoredFiles
from service.study_results import StudyResults
from service.webhook_addresses import Receivers

_JOB_ID: Final = re.compile(r"[0-9a-f]{12}")


@dataclass(frozen=True)
class Parts:
    """The queue, the blob store, and the checks of what comes in."""

    jobs: Jobs
    scenes: SceneIndex
    batches: Batches
    continuations: Continuations
    studies: Studies
    study_results: StudyResults
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
