"""The client follows jobs: typed events, time-outs, callbacks."""

import time

import pytest
import redis

from plateau import (
    Client,
    FinishedEvent,
    ImageEvent,
    PointEvent,
    SliceEvent,
    StateEvent,
    TimedOut,
    TroubleEvent,
    Unreachable,
)
from plateau.farm.model.states import JobState
from plateau.service.api.process import listen
from tests.support.farms.staged_job import StagedJob
from tests.support.threads import beside


def test_each_event_has_a_type_of_its_own(plateau: Client, client: redis.Redis) -> None:
    job = StagedJob(client)
    job.die("SIGSEGV")
    job.commit()
    job.point(25, 7, slope=0.5)
    job.end(JobState.EXHAUSTED, "at its cap")
    job.finish()
    events = list(plateau.events(job.id))
    happened = plateau.happened(job.id)
    assert [(type(one), one.id) for one in happened] == [(type(one), one.id) for one in events]
    kinds = [StateEvent, StateEvent, TroubleEvent, SliceEvent, PointEvent, StateEvent]
    assert [type(event) for event in events] == [*kinds, ImageEvent, FinishedEvent]
    _, rendering, trouble, committed, judged, ended, shown, _ = events
    assert isinstance(rendering, StateEvent)
    assert rendering.state is JobState.RENDERING
    assert isinstance(trouble, TroubleEvent)
    assert (trouble.index, trouble.worker, trouble.cause) == (0, "worker-1", "SIGSEGV")
    assert isinstance(committed, SliceEvent)
    assert (committed.index, committed.worker) == (0, "worker-1")
    assert isinstance(judged, PointEvent)
    assert isinstance(happened[4], PointEvent)
    assert judged.point == happened[4].point == plateau.curve(job.id)[0]
    assert isinstance(ended, StateEvent)
    assert (ended.state, ended.reason) == (JobState.EXHAUSTED, "at its cap")
    assert isinstance(shown, ImageEvent)
    assert shown.spp == 100


def test_a_wait_tells_of_what_happens_from_the_beginning(
    plateau: Client, client: redis.Redis
) -> None:
    job = StagedJob(client)
    job.commit()
    heard: list[str] = []

    def hear(event: object) -> None:
        heard.append(type(event).__name__)
        if heard == ["StateEvent", "StateEvent", "SliceEvent"]:
            job.end()
            job.finish()

    assert plateau.wait(job.id, on_event=hear, timeout_s=280).state is JobState.CONVERGED
    assert heard[3:] == ["StateEvent", "ImageEvent", "FinishedEvent"]


def test_what_a_callback_raises_ends_the_wait(plateau: Client, client: redis.Redis) -> None:
    def stop(_: object) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        plateau.wait(StagedJob(client).id, on_event=stop)


def test_a_wait_ends_in_time_though_the_service_says_nothing(
    plateau: Client, client: redis.Redis, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("plateau.service.api.routes.results._HEARTBEAT_S", 600.0)
    job = StagedJob(client)
    started = time.monotonic()
    with pytest.raises(TimedOut, match=f"job {job.id} is not finished after 0.6 s") as caught:
        plateau.wait(job.id, timeout_s=0.6)
    # And not only as the stream says that it is still there
    assert 0.5 <= time.monotonic() - started < 290
    assert isinstance(caught.value, TimeoutError)
    # The job goes on, and can be waited for again
    assert plateau.job(job.id).state is JobState.QUEUED


def test_a_wait_ends_in_time_though_much_is_going_on(plateau: Client, client: redis.Redis) -> None:
    job, heard, timeout_s = StagedJob(client, max_spp=1_000_000), list[int](), 1.25

    def hear(event: object) -> None:
        heard.extend([event.index] if isinstance(event, SliceEvent) else [])

    with beside(job.commit, pause_s=0.05):
        while not heard:  # on a busy machine, not at first
            started, timeout_s = time.monotonic(), 2 * timeout_s
            with pytest.raises(TimedOut):
                plateau.wait(job.id, timeout_s=timeout_s, on_event=hear)
            assert time.monotonic() - started >= timeout_s - 0.1
    # The stream was opened anew as the time ran out, and yet each slice was heard of once
    assert heard == list(range(len(heard)))


def test_a_wait_for_a_service_that_is_away_ends_in_time_too() -> None:
    with listen("127.0.0.1", 0) as silent:  # it is nobody else's port, and nobody listens
        url = f"http://127.0.0.1:{silent.getsockname()[1]}"
        with Client(url, patience_s=600) as client, pytest.raises(TimedOut):
            client.wait("0123456789ab", timeout_s=0.6)
        with Client(url, patience_s=0) as client, pytest.raises(Unreachable):
            client.wait("0123456789ab", timeout_s=60)
