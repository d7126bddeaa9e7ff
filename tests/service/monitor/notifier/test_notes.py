"""Targets that the operator names are notified of jobs and whole batches."""

import base64
import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import redis

from plateau.farm.blobs.store import Blobs
from plateau.farm.images.png import encode_png
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.outbox import Outbox
from plateau.farm.model.states import JobState
from plateau.farm.process.settings import Settings
from plateau.farm.redis import keys
from plateau.farm.redis.link import connect
from plateau.farm.redis.wake import Wake
from plateau.service.monitor.notifier import notifier as module
from plateau.service.monitor.notifier.notes import Notes
from plateau.service.monitor.notifier.notifier import Notifier
from plateau.service.monitor.notifier.requests import Requests
from plateau.service.notices.receivers import Receivers
from plateau.service.notices.targets import BadTargets, Targets, read_targets
from tests.support.farms.receiver import OK, Receiver, receiving
from tests.support.farms.staged_job import StagedJob
from tests.support.threads import working
from tests.support.until import until

PATH = "a-secret-path"


@contextmanager
def notifying(redis_url: str, notes: Notes, requests: Requests | None = None) -> Iterator[Notifier]:
    """A notifier that tries again soon."""
    client = connect(redis_url)
    notifier = Notifier(
        Outbox(client),
        Wake(client, keys.WAKE_NOTIFIER),
        requests or Requests(Receivers(())),
        notes,
        lease_s=30.0,
        delay_s=lambda _tries, asked_s: max(0.05, asked_s),
        poll_s=0.05,
    )
    with working(notifier.run, notifier.stop):
        yield notifier


def ended(client: redis.Redis, *targets: str) -> StagedJob:
    job = StagedJob(client, notice={"targets": targets})
    job.commit(4)
    job.point(100, visible=3)
    job.end(JobState.CONVERGED, "levelled off")
    job.finish()
    return job


def by_json(url: str) -> str:
    """The URL of apprise that POSTs JSON there."""
    return f"{url.replace('http', 'json', 1).partition('/hook')[0]}/{PATH}?cto=120&rto=120"


def delivered(client: redis.Redis, job: StagedJob) -> bool:
    return {one.state for one in Jobs(client).get(job.id).notices} == {"delivered"}


def told(receiver: Receiver) -> list[dict[str, Any]]:
    """The notes that came, as apprise POSTs them."""
    return [json.loads(one.body) for one in receiver.received]


def test_a_note_says_what_ended_and_why(client: redis.Redis, redis_url: str) -> None:
    with receiving() as receiver:
        targets = Targets({"ops": by_json(receiver.url)})
        with notifying(redis_url, Notes(targets, "https://farm/")):
            job = ended(client, "ops")
            until(lambda: delivered(client, job))
    [note] = told(receiver)
    assert note["title"] == "box converged"
    for words in (f"Job {job.id}: levelled off", "100 spp", "noise left 0.1"):
        assert words in note["message"]
    assert f"https://farm/jobs/{job.id}" in note["message"]


def test_it_has_a_small_picture_where_there_is_one(
    client: redis.Redis, redis_url: str, tmp_path: Path
) -> None:
    png, store = encode_png(np.full((6, 8, 3), 200, np.uint8)), Blobs(str(tmp_path / "blobs"))
    file = tmp_path / "targets"
    with receiving() as receiver:
        file.write_text(f"json {by_json(receiver.url)}\n")
        with module.notifying(Settings(redis_url=redis_url, notify_file=file), store):
            job = StagedJob(client, name="seen", notice={"targets": ["json"]})
            job.commit(4)
            job.picture(store, "thumbnail.png", png)
            job.end()
            job.finish()
            bare = ended(client, "json")  # it has lost its picture
            until(lambda: delivered(client, bare) and delivered(client, job))
    attached = {note["title"]: note["attachments"] for note in told(receiver)}
    assert attached["box converged"] == []
    [picture] = attached["seen converged"]
    assert (picture["filename"], base64.b64decode(picture["base64"])) == ("image.png", png)


def test_it_is_tried_again_until_it_succeeds_and_nobody_sees_the_url(
    client: redis.Redis, redis_url: str, caplog: pytest.LogCaptureFixture
) -> None:
    answers = lambda number, _: (500, {}) if number < 2 else OK  # noqa: E731
    with receiving(answers) as receiver:
        targets = Targets({"ops": by_json(receiver.url)})
        with notifying(redis_url, Notes(targets)):
            job = ended(client, "ops")
            until(lambda: delivered(client, job))
    assert "`plateau doctor --notify ops` on this machine says why; try 2 follows" in caplog.text
    assert told(receiver)[1]["title"] == "box converged"
    assert PATH in receiver.received[1].path
    assert PATH not in caplog.text + Jobs(client).get(job.id).model_dump_json()


def test_of_a_batch_they_hear_of_what_failed_and_of_its_end(
    client: redis.Redis, redis_url: str
) -> None:
    asked = {"batch": "walk", "notice": {"targets": ["ops"]}}
    first, second, third = (StagedJob(client, **asked) for _ in range(3))
    second.end(JobState.FAILED, "no such plugin")
    second.finish()
    for job in (first, third):
        job.end(JobState.CANCELLED, "not needed")
        job.finish()
    with receiving() as receiver:
        targets = Targets({"ops": by_json(receiver.url)})
        with notifying(redis_url, Notes(targets)):
            receiver.wait_for(2)
            until(lambda: delivered(client, third))
    notes = {one["title"]: one["message"] for one in told(receiver)}
    assert {*notes} == {"box failed", "batch walk has ended"}
    assert "no such plugin" in notes["box failed"]
    assert "3 jobs: 2 cancelled, 1 failed" in notes["batch walk has ended"]


class TestTheFileOfTargets:
    def test_has_names_and_urls(self, tmp_path: Path) -> None:
        file = tmp_path / "targets"
        file.write_text("# who\nops json://127.0.0.1/x\n\nlead  slack://a/b/c\n")
        found = read_targets(Settings(notify_file=file, notify="ops"))
        assert found.urls == {"ops": "json://127.0.0.1/x", "lead": "slack://a/b/c"}
        assert found.with_always(("lead",)) == ("lead", "ops")
        assert "slack" not in repr(found)

    @pytest.mark.parametrize("line", [f"ops {PATH}", f"json://{PATH}", f"o/p json://{PATH}"])
    def test_is_refused_without_showing_its_secrets(self, line: str, tmp_path: Path) -> None:
        file = tmp_path / "targets"
        file.write_text(f"lead json://x\n{line}\n")
        with pytest.raises(BadTargets, match="line 2") as refused:
            read_targets(Settings(notify_file=file))
        assert PATH not in str(refused.value)

    def test_has_every_name_that_is_notified_of_all(self) -> None:
        with pytest.raises(BadTargets, match="no target 'ops'"):
            read_targets(Settings(notify="ops"))
