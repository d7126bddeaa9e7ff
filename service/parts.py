"""What the routes work with, handed to the app when it is made."""

import re
from dataclasses import dataclass
from typing import Final

from fastapi import Request

from farm.blobs import Blobs
from farm.bundle import BundleLimits
from farm.errors import JobNotFound
from farm.job import Job
from farm.jobs import Jobs
from service.event_hub import EventHub

_JOB_ID: Final = re.compile(r"[0-9a-f]{12}")


@dataclass(frozen=True)
class Parts:
    """The queue, the blob store, and the limits on what comes in."""

    jobs: Jobs
    blobs: Blobs
    limits: BundleLimits
    hub: EventHub

    def job(self, job_id: str) -> Job:
        """The job, or `JobNotFound`; what cannot be an id is not looked up."""
        if not _JOB_ID.fullmatch(job_id):
            raise JobNotFound(job_id)
        return self.jobs.get(job_id)


def parts(request: Request) -> Parts:
    """The parts of the app that serves the request."""
    found: Parts = request.app.state.parts
    return found
