"""Messages to the targets that the farm's operator names, sent by apprise.

Apprise says why a message was not sent in log lines alone, which may show parts of a URL. So they
are kept from the farm's log and from users: `plateau doctor --notify` shows them to the operator.
"""

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Final

from plateau.errors import needs
from plateau.farm.ledger.outbox import Taken
from plateau.farm.model.job import Job
from plateau.farm.model.states import JobState
from plateau.farm.wire.figures import duration, percent
from plateau.service.notices.targets import Targets, UnknownTarget

_APPRISE: Final = logging.getLogger("apprise")
_APPRISE.addHandler(logging.NullHandler())
_APPRISE.propagate = False

_COUNTED: Final = {
    JobState.CONVERGED: "converged",
    JobState.EXHAUSTED: "reached their limit",
    JobState.CANCELLED: "cancelled",
    JobState.FAILED: "failed",
}


class NotNotified(Exception):
    """A target was not notified; the message says so without its URL."""

    def __init__(self, message: str, said: str = "") -> None:
        super().__init__(message)
        self.said = said  #: by apprise; for the operator's eyes


@dataclass(frozen=True)
class Note:
    """A message as people read it, with a PNG if there is one and the service takes it."""

    subject: str
    body: str
    picture: bytes | None = field(default=None, repr=False)


@dataclass(frozen=True)
class Notes:
    """Sends notes to targets; with a `url` they say where a job is seen.

    Parameters
    ----------
    targets
        Who can be notified.
    url
        Of the farm's page, as its users reach it.
    picture
        Finds a small PNG of a job's image, by the job's id; None where there is none.
    """

    targets: Targets = field(default_factory=Targets)
    url: str | None = None
    picture: Callable[[str], bytes | None] = lambda _: None

    def tell(self, taken: Taken) -> None:
        """Notify the notice's target, or raise `NotNotified`."""
        try:
            url = self.targets.url(taken.receiver)
        except UnknownTarget as error:
            raise NotNotified(f"for this monitor {error}") from error
        job, batch = taken.job, taken.batch
        note = self.of_job(job) if batch is None else self.of_batch(job, batch)
        send(taken.receiver, url, replace(note, picture=self.picture(job.id)))

    def of_job(self, job: Job) -> Note:
        """The note that a job has ended."""
        facts = [f"{job.spp:,} spp"]
        if job.started_at is not None and job.ended_at is not None:
            facts.append(f"in {duration((job.ended_at - job.started_at).total_seconds())}")
        if job.estimate_fraction is not None:
            facts.append(f"noise left {percent(job.estimate_fraction)} of the pixels")
        lines = [f"Job {job.id}: {job.reason}", ", ".join(facts)]
        ended = "was cancelled" if job.state is JobState.CANCELLED else job.outcome
        return Note(f"{job.name} {ended}", self._with_link(lines, job))

    def of_batch(self, job: Job, states: Mapping[str, int]) -> Note:
        """The note that all jobs of a batch have ended; `job` was the last."""
        counts = [f"{states[one]} {words}" for one, words in _COUNTED.items() if one in states]
        lines = [f"{sum(states.values())} jobs: {', '.join(counts)}", f"The last was {job.name}."]
        return Note(f"batch {job.spec.batch} has ended", self._with_link(lines, job))

    def _with_link(self, lines: list[str], job: Job) -> str:
        link = [f"{self.url.rstrip('/')}/jobs/{job.id}"] if self.url else []
        return "\n".join((*lines, *link))


def send(name: str, url: str, note: Note) -> None:
    """Send a note to the target of this name and URL; raises `NotNotified`."""
    with needs("notify"):
        import apprise
        from apprise.attachment.memory import AttachMemory

    picture = note.picture and AttachMemory(note.picture, "image.png", "image/png")  # type: ignore[no-untyped-call]
    asset = apprise.AppriseAsset(async_mode=False, app_id="Plateau", app_desc="render farm")
    service = apprise.Apprise(asset=asset)
    with apprise.LogCapture(level=logging.WARNING) as lines:  # type: ignore[no-untyped-call]
        sent = service.add(url) and service.notify(
            title=note.subject,
            body=note.body,
            body_format=apprise.NotifyFormat.TEXT,
            attach=picture or None,
        )
        said = lines.getvalue().strip()
    if not sent:
        raise NotNotified(
            f"{name} was not notified; `plateau doctor --notify {name}` on this machine says why",
            said,
        )
