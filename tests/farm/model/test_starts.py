"""When queued jobs will start, as far as the work before them tells."""

from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from plateau.farm.model.starts import OpenJob, Start, expected_start, expected_starts

ONE, TWO = frozenset({"w1"}), frozenset({"w1", "w2"})
SLICE_S, TURN_S = 2.0, 20.0


def job(name: str, priority: int = 0, workers: frozenset[str] = ONE, **more: object) -> OpenJob:
    """An open job that waits; its name ends with its number."""
    return OpenJob(
        id=name,
        number=int(name[1:]),
        priority=priority,
        workers=workers,
        **{"left_s": 100.0, **more},  # type: ignore[arg-type]
    )


#: Under way on one worker, or on two.
BUSY = job("a0", leased=1)
BUSY_TWO = job("a0", leased=2, workers=TWO, left_s=300.0)


@pytest.mark.parametrize(
    ("queue", "asked", "expected"),
    [
        pytest.param([], job("b1"), 0, id="an idle worker takes it at once"),
        pytest.param([job("c1")], job("b2"), 20, id="and the next one when its turn ends"),
        pytest.param([BUSY], job("b1"), 11, id="one worker: when a turn of the older job ends"),
        pytest.param([BUSY, job("c1")], job("b2"), 200, id="after the two that take turns"),
        pytest.param([BUSY, job("c9")], job("b1"), 11, id="but not after a younger one"),
        pytest.param([BUSY, job("c9", priority=5)], job("b1"), 111, id="a higher priority first"),
        pytest.param([BUSY], job("b1", priority=5), 1, id="at the end of a slice, if it is higher"),
        pytest.param([job("c0", left_s=0.0)], job("b1"), 0, id="not after a job without work"),
        pytest.param([job("c1", workers=frozenset({"x"}))], job("b2"), 0, id="other workers' job"),
        pytest.param(
            [BUSY_TWO], job("b1", workers=TWO), 22 / 3, id="two workers: when the first's turn ends"
        ),
        pytest.param(
            [replace(BUSY_TWO, left_s=6.0)],
            job("b1", workers=TWO),
            3,
            id="or its job ends, if sooner",
        ),
        pytest.param(
            [replace(BUSY, left_s=3.0), job("c1")],
            job("b2"),
            28,
            id="after a whole turn of the one that follows a job which ends soon",
        ),
        pytest.param(
            [BUSY_TWO, job("c1", workers=TWO), job("c2", workers=TWO)],
            job("b3", workers=TWO),
            150,
            id="one more than there are workers",
        ),
        pytest.param(
            [replace(BUSY, batch="walk"), job("c1")],
            job("b2", batch="walk"),
            200,
            id="a batch's next frame follows, and is no further party",
        ),
        pytest.param(
            [job(f"c{n}", batch="walk", workers=TWO) for n in range(1, 4)],
            job("b4", workers=TWO),
            0,
            id="a batch is one party",
        ),
        pytest.param(
            [BUSY_TWO, *(job(f"c{n}", workers=TWO, owner="x") for n in range(1, 9))],
            job("b9", workers=TWO, owner="y"),
            22 / 3,
            id="other owners have their turns, however many jobs one has",
        ),
        pytest.param(
            [job("c1", workers=TWO, leased=2), job("c2")],
            job("b3"),
            122,
            id="a job of more workers takes its share of this one",
        ),
    ],
)
def test_the_work_before_it_comes_first(
    queue: list[OpenJob], asked: OpenJob, expected: float
) -> None:
    start = expected_start(asked, queue, SLICE_S, TURN_S)
    assert start is not None
    assert start.seconds == pytest.approx(expected)


def test_without_a_fitting_worker_it_is_not_known() -> None:
    assert expected_start(job("b1", workers=frozenset()), [BUSY], SLICE_S) is None


def test_it_is_a_bound_where_the_jobs_before_it_count_to_their_caps() -> None:
    capped, other = replace(BUSY, is_capped=True), job("c1")
    assert expected_start(job("b2"), [capped, other], SLICE_S) == Start(200, is_bound=True)
    assert expected_start(job("b2"), [BUSY, other], SLICE_S) == Start(200, is_bound=False)
    # A job's own cap, and those of jobs after it, say nothing of its start
    own = job("b1", is_capped=True)
    assert expected_start(own, [job("c2", is_capped=True)], SLICE_S) == Start(0, is_bound=False)
    above = replace(capped, priority=7)
    assert expected_start(job("b1"), [above], SLICE_S) == Start(100, is_bound=True)


WORKERS = st.frozensets(st.sampled_from(["w1", "w2", "w3"]), min_size=1)
QUEUES = st.lists(
    st.tuples(
        st.integers(-1, 1),
        WORKERS,
        st.sampled_from(["", "x", "y"]),
        st.sampled_from(["", "", "walk", "run"]),
        st.integers(0, 2),
        st.floats(0, 1000),
        st.booleans(),
    ),
    min_size=1,
    max_size=12,
).map(
    lambda rows: [
        OpenJob(
            id=f"j{number}",
            number=number,
            priority=priority,
            workers=workers,
            owner=owner,
            batch=batch,
            leased=leased,
            left_s=left_s,
            is_capped=is_capped,
        )
        for number, (priority, workers, owner, batch, leased, left_s, is_capped) in enumerate(rows)
    ]
)
SECONDS = st.floats(0.01, 100)


@given(QUEUES, SECONDS, SECONDS)
def test_it_is_never_negative_and_each_job_has_one(
    queue: list[OpenJob], slice_s: float, turn_s: float
) -> None:
    starts = expected_starts(queue, queue, slice_s, turn_s)
    assert set(starts) == {one.id for one in queue}
    assert all(start.seconds >= 0 for start in starts.values())


@given(QUEUES, SECONDS, SECONDS)
def test_those_that_come_first_start_first(
    queue: list[OpenJob], slice_s: float, turn_s: float
) -> None:
    starts = expected_starts(queue, queue, slice_s, turn_s)
    alike: dict[object, list[OpenJob]] = {}
    for one in queue:
        alike.setdefault((one.workers, one.owner, one.party), []).append(one)
        if not one.batch:
            alike.setdefault((one.workers, one.owner, "singles"), []).append(one)
    for jobs in alike.values():
        in_order = sorted(jobs, key=lambda one: (-one.priority, one.number))
        for before, after in pairwise(in_order):
            assert starts[before.id].seconds <= starts[after.id].seconds + 1e-6


@given(QUEUES, st.integers(0, 11), st.floats(0, 1000), SECONDS, SECONDS)
def test_more_work_starts_nothing_earlier(
    queue: list[OpenJob], which: int, more_s: float, slice_s: float, turn_s: float
) -> None:
    which %= len(queue)
    longer = replace(queue[which], left_s=queue[which].left_s + more_s)
    before = expected_starts(queue, queue, slice_s, turn_s)
    now = [longer if one.id == longer.id else one for one in queue]
    after = expected_starts(now, now, slice_s, turn_s)
    for one in queue:
        assert after[one.id].seconds >= before[one.id].seconds - 1e-6
