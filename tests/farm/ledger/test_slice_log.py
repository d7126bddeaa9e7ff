"""The log of a job says how each try of a slice ended, and never another thing than the ledger."""

import pytest
import redis

from plateau.farm.ledger.queue import Lease, SliceQueue
from plateau.farm.model.job import Job
from plateau.farm.redis import keys
from tests.support.farms.ledger_farm import LedgerFarm, commit, lease


@pytest.fixture
def farm(client: redis.Redis) -> LedgerFarm:
    return LedgerFarm(client)


def said(worker: SliceQueue, held: Lease, words: str) -> str:
    """Commit a slice during which the render child printed something."""
    return commit(worker, held, said=words, blob=f"words-{held.index}", render_s=2.5)


def told(farm: LedgerFarm, job: Job) -> list[tuple[int, str, str, str | None, str]]:
    return [(one.slice, one.what, one.worker, one.cause, one.text) for one in farm.jobs.log(job.id)]


def test_a_silent_slice_costs_its_line_in_the_ledger_alone(
    farm: LedgerFarm, client: redis.Redis
) -> None:
    job, _ = farm.job()
    worker = farm.worker("w")
    commit(worker, lease(worker))
    assert not client.exists(keys.job(job.id, "log"))
    (entry,) = farm.jobs.log(job.id)
    assert (entry.slice, entry.what, entry.worker, entry.seconds) == (0, "committed", "w", 1.5)
    assert (entry.cause, entry.text) == (None, "")


def test_each_way_in_which_a_try_ends_is_told_in_its_order(farm: LedgerFarm) -> None:
    job, owned = farm.job(slices=1)
    worker, other = farm.worker("w"), farm.worker("other")
    worker.hand_back(lease(worker), 1.0, cause="the worker stops")
    worker.hand_back(lease(worker), cause="no LLVM", unfit=True)
    worker.died(lease(worker), "SIGSEGV", 0.25, "last words")
    said(worker, lease(worker), "a warning")
    (record,) = farm.owners.committed(job.id, range(1))
    farm.owners.reject(owned, record, "it is gone")
    # The second commit is silent, and follows from the ledger
    commit(other, lease(other))
    assert told(farm, job) == [
        (0, "handed-back", "w", "the worker stops", ""),
        (0, "unfit", "w", "no LLVM", ""),
        (0, "died", "w", "SIGSEGV", "last words"),
        (0, "committed", "w", None, "a warning"),
        (0, "rejected", "w", "it is gone", ""),
        (0, "committed", "w", None, ""),
    ]
    assert [one.seconds for one in farm.jobs.log(job.id)] == [1.0, 0.0, 0.25, 2.5, None, 1.5]


def test_the_try_that_fails_a_job_is_the_last_that_is_told(farm: LedgerFarm) -> None:
    job, _ = farm.job()
    worker = farm.worker("w")
    held, late = lease(worker), lease(worker)
    worker.fail(held, "no such plugin", 0.5, "a warning")
    worker.fail(held, "no such plugin", 0.5, "a warning")
    # What ends after its job is no news: the job's own story says what became of it
    worker.died(late, "SIGKILL", 1.0)
    worker.hand_back(late, cause="late")
    assert said(worker, late, "late") == "ended"
    assert told(farm, job) == [(0, "failed", "w", "no such plugin", "a warning")]


def test_a_worker_that_was_lost_is_told_by_who_takes_over(farm: LedgerFarm) -> None:
    job, _ = farm.job(slices=1)
    lost, other = farm.worker("lost"), farm.worker("other")
    late = lease(lost)
    farm.runs_out(late)
    taken = lease(other)
    commit(other, taken)
    # And its late commit, which does not count
    assert commit(lost, late, blob="late") == "duplicate"
    assert [(one.what, one.worker) for one in farm.jobs.log(job.id)] == [
        ("died", "lost"),
        ("committed", "w"),
        ("duplicate", "lost"),
    ]


def test_what_is_kept_is_bounded(farm: LedgerFarm, client: redis.Redis) -> None:
    job, _ = farm.job(slices=1)
    worker = farm.worker("w")
    # Given a child that prints without end, in letters of several bytes
    words = "é€😀" * 3000 + "the end"
    for padding in ("", "x", "xx", "xxx"):
        worker.hand_back(lease(worker), cause=words, said=words + padding)
    for entry in farm.jobs.log(job.id):
        assert "the end" in entry.text
        assert 4096 - 4 < len(entry.text.encode()) <= 4096
        assert entry.cause is not None
        assert 1024 - 4 < len(entry.cause.encode()) <= 1024
        assert entry.text.strip("x").removesuffix("the end") in words
    # And a slice that is handed back without end
    (_, fields), *_ = client.xrange(keys.job(job.id, "log"), count=1)
    pipe = client.pipeline()
    for _ in range(2300):
        pipe.xadd(keys.job(job.id, "log"), fields)
    pipe.execute()
    worker.hand_back(lease(worker), cause="again")
    assert client.xlen(keys.job(job.id, "log")) < 2100
    assert farm.jobs.log(job.id)[-1].cause == "again"
