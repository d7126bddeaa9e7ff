"""How many workers are wanted, and who comes and goes: stories told in snapshots, without Slurm."""

from collections.abc import Iterable
from datetime import datetime, timedelta, timezone
from itertools import pairwise

import pytest

from plateau.farm.ledger.totals import Demand
from plateau.farm.model.worker import Worker
from plateau.scale.policy import MOST_AT_ONCE, Limits, Policy, worth
from plateau.scale.tasks import ScalingPlan, Snapshot, Task, TaskState

START = datetime(2026, 11, 21, tzinfo=timezone.utc)
LIMITS = Limits(most=8, worth_s=60, calm_s=60, idle_s=30)


def demand(workers: float) -> Demand:
    """Work that is worth so many workers."""
    return Demand(waiting=20, leased=0, left=1000, work_s=60 * workers) if workers else Demand()


class Farm:
    """Slurm and its workers as the policy sees them, and a clock that the test turns."""

    def __init__(self, limits: Limits = LIMITS) -> None:
        self.policy = Policy(limits)
        self.now_s = 1000.0
        self.states: dict[str, TaskState] = {}
        self.workers: dict[str, Worker] = {}

    def snapshot(
        self, workers_worth: float, *, others: int = 0, after_s: float = 10
    ) -> ScalingPlan:
        """Take another snapshot; what was planned by then is done."""
        self.now_s += after_s
        seen_at = START + timedelta(seconds=self.now_s)
        self.workers = {
            task: worker.model_copy(update={"seen_at": seen_at})
            for task, worker in self.workers.items()
        }
        plan = self.policy.plan(
            Snapshot(
                now_s=self.now_s,
                demand=demand(workers_worth),
                tasks=tuple(Task(id=one, state=state) for one, state in self.states.items()),
                workers=self.workers,
                others=others,
            )
        )
        for _ in range(plan.submit):
            self.states[f"1_{len(self.states) + 1}"] = TaskState.WAITS
        self.policy.starts.note_submitted(plan.submit)
        for task in (*plan.cancel, *plan.end):
            self.leave(task)
        for task in plan.drain:
            self.change(task, drained=True)
        return plan

    def run(self, *tasks: str) -> None:
        """Slurm starts these, or all that wait, and their workers render."""
        for task in tasks or tuple(self.states):
            self.states[task] = TaskState.RUNS
            self.workers[task] = Worker(
                id=f"w-{task}",
                host="n1",
                pid=1,
                variants=("scalar_rgb",),
                threads=1,
                job="box",
                slice=0,
                slices_done=0,
                samples_per_s=None,
                last_error=None,
                started_at=START,
                seen_at=START,
            )

    def change(self, task: str, **fields: object) -> None:
        self.workers[task] = self.workers[task].model_copy(update=fields)

    def idle(self, *tasks: str) -> None:
        for task in tasks or tuple(self.workers):
            self.change(task, job=None, slice=None)

    def leave(self, task: str) -> None:
        del self.states[task]
        self.workers.pop(task, None)

    def count(self, state: TaskState) -> int:
        return list(self.states.values()).count(state)


@pytest.fixture
def farm() -> Farm:
    return Farm()


def snapshots(farm: Farm, workers_worth: float, times: int) -> Iterable[ScalingPlan]:
    return [farm.snapshot(workers_worth) for _ in range(times)]


class TestWorth:
    @pytest.mark.parametrize(
        ("work", "workers"),
        [
            (Demand(), 0),
            (Demand(waiting=1, left=1, work_s=0.01), 1),
            (Demand(leased=1, left=1, work_s=0.01), 1),
            (Demand(waiting=5, leased=1, left=90, work_s=61), 2),
            (Demand(waiting=9, leased=1, left=10_000, work_s=60_000), 1000),
            # Of slices that take ten minutes each, one worker for each
            (Demand(waiting=2, leased=1, left=3, work_s=1800), 3),
        ],
    )
    def test_is_a_minute_of_work_each_or_a_slice(self, work: Demand, workers: int) -> None:
        assert worth(work, 60) == workers


class TestComing:
    @pytest.mark.parametrize(("worth", "come"), [(0, 0), (3, 3), (1000, 8)])
    def test_as_many_as_the_work_is_worth_and_the_limit_allows_at_once_and_once(
        self, farm: Farm, worth: float, come: int
    ) -> None:
        assert [plan.submit for plan in snapshots(farm, worth, 3)] == [come, 0, 0]
        # And when they run
        farm.run()
        assert not any(plan.acts for plan in snapshots(farm, worth, 3))

    def test_in_arrays_of_a_size_that_slurm_takes(self) -> None:
        farm = Farm(Limits(most=10_000))
        assert [plan.submit for plan in snapshots(farm, 230, 4)] == [
            MOST_AT_ONCE,
            MOST_AT_ONCE,
            30,
            0,
        ]

    def test_fewer_where_others_do_the_same_work(self, farm: Farm) -> None:
        assert farm.snapshot(5, others=3).submit == 2
        assert farm.snapshot(5, others=9).submit == 0

    def test_none_beside_one_that_finds_nothing_to_do(self, farm: Farm) -> None:
        farm.snapshot(1)
        farm.run()
        farm.idle()  # it cannot do this work
        assert [plan.submit for plan in snapshots(farm, 6, 5)][-1] == 0

    def test_one_that_slurm_started_again_is_not_doubled(self, farm: Farm) -> None:
        farm.snapshot(2)
        farm.run()
        # When a node dies: Slurm has its task wait again, its worker was heard of lately
        farm.states["1_1"] = TaskState.WAITS
        assert not any(plan.acts for plan in snapshots(farm, 2, 3))


class TestGoing:
    def test_waits_until_less_was_wanted_for_long(self, farm: Farm) -> None:
        farm.snapshot(4)
        assert [len(plan.cancel) for plan in snapshots(farm, 1, 8)] == [0, 0, 0, 0, 0, 0, 3, 0]

    def test_and_starts_anew_with_each_rise_so_that_nothing_flaps(self, farm: Farm) -> None:
        farm.snapshot(4)
        for _ in range(20):  # a job every fifty seconds
            plans = [*snapshots(farm, 0, 4), farm.snapshot(4)]
            assert not any(plan.acts for plan in plans)

    def test_the_last_that_wait_go_first(self, farm: Farm) -> None:
        farm.snapshot(4)
        farm.run("1_1", "1_2")
        (*_, plan) = snapshots(farm, 3, 7)
        assert plan.cancel == ("1_4",)

    def test_then_those_whose_worker_has_not_come_yet(self, farm: Farm) -> None:
        farm.snapshot(4)
        farm.run("1_1", "1_2")
        farm.states["1_3"] = TaskState.RUNS
        (*_, plan) = snapshots(farm, 1, 7)
        assert (plan.cancel, plan.end, plan.drain) == (("1_4",), ("1_3",), ())

    def test_then_who_has_nothing_to_do_and_nobody_who_renders(self, farm: Farm) -> None:
        farm.snapshot(3)
        farm.run()
        snapshots(farm, 1, 10)
        assert farm.count(TaskState.RUNS) == 3
        farm.idle("1_2")
        plans = list(snapshots(farm, 1, 6))
        # Drained once it was idle for long, and asked to leave after its next heartbeat
        assert [plan.drain for plan in plans] == [(), (), (), ("1_2",), (), ()]
        assert [plan.end for plan in plans] == [(), (), (), (), ("1_2",), ()]
        assert farm.count(TaskState.RUNS) == 2

    def test_one_that_took_a_slice_before_it_was_drained_finishes_it(self, farm: Farm) -> None:
        farm.snapshot(1)
        farm.run()
        farm.idle()
        (*_, last) = snapshots(farm, 0, 7)
        assert last.drain == ("1_1",)
        farm.change("1_1", job="box")
        assert [plan.end for plan in snapshots(farm, 0, 2)] == [(), ()]
        farm.idle()
        assert farm.snapshot(0).end == ("1_1",)

    def test_one_that_takes_its_time_to_leave_is_asked_once(self, farm: Farm) -> None:
        farm.snapshot(2)
        farm.run("1_1")
        farm.states["1_2"] = TaskState.RUNS  # and no worker yet
        farm.idle("1_1")
        farm.change("1_1", drained=True)
        asked: list[str] = []
        for _ in range(12):
            before = dict(farm.states), dict(farm.workers)
            asked += farm.snapshot(0).end
            farm.states, farm.workers = before
        assert sorted(asked) == ["1_1", "1_2"]

    def test_what_was_drained_before_a_restart_is_ended_after_it(self, farm: Farm) -> None:
        farm.snapshot(1)
        farm.run()
        farm.idle()
        farm.change("1_1", drained=True)
        farm.policy = Policy(LIMITS)
        assert [plan.end for plan in snapshots(farm, 0, 2)] == [(), ("1_1",)]

    def test_short_pauses_between_slices_are_no_idleness(self, farm: Farm) -> None:
        farm.snapshot(1)
        farm.run()
        for done in range(20):
            farm.change("1_1", job=None, slices_done=done)
            assert not farm.snapshot(0).acts

    def test_the_least_come_and_stay_without_any_work(self) -> None:
        farm = Farm(Limits(least=2, most=4))
        assert farm.snapshot(0).submit == 2
        farm.snapshot(4)
        farm.run()
        farm.idle()
        snapshots(farm, 0, 20)
        assert farm.count(TaskState.RUNS) == 2
        assert not any(plan.acts for plan in snapshots(farm, 0, 20))

    def test_a_lower_limit_drains_those_who_render_too(self, farm: Farm) -> None:
        farm.snapshot(4)
        farm.run()
        farm.policy = Policy(Limits(most=1))
        assert len(farm.snapshot(4).drain) == 3
        assert farm.snapshot(4).end == ()
        farm.idle()
        assert len(farm.snapshot(4).end) == 3


class TestWhatComesToNothing:
    def test_is_tried_again_later_and_later(self, farm: Farm) -> None:
        tries_s = []
        for _ in range(200):
            if farm.snapshot(1).submit:
                tries_s.append(farm.now_s)
                farm.leave(*farm.states)  # it ends at once, without a word
        gaps = [later - sooner for sooner, later in pairwise(tries_s)]
        assert gaps == sorted(gaps)
        assert gaps[0] < 60
        assert gaps[-1] > 300

    def test_is_forgotten_when_a_worker_comes(self, farm: Farm) -> None:
        farm.snapshot(1)
        farm.leave("1_1")
        assert farm.snapshot(1).held_s > 0
        while not farm.states:
            farm.snapshot(1)
        farm.run()
        snapshots(farm, 1, 2)
        farm.leave(*farm.states)  # at its time limit
        assert farm.snapshot(1).submit == 1

    def test_is_not_what_we_have_cancelled_ourselves(self, farm: Farm) -> None:
        farm.snapshot(4)
        snapshots(farm, 0, 8)
        assert farm.states == {}
        assert farm.snapshot(4).submit == 4

    def test_includes_what_slurm_refused(self, farm: Farm) -> None:
        farm.policy.starts.note_failure(farm.now_s)
        assert [plan.submit for plan in snapshots(farm, 1, 4)] == [0, 0, 1, 0]

    def test_a_worker_that_can_render_nothing_leaves_and_is_replaced_later(
        self, farm: Farm
    ) -> None:
        farm.snapshot(1)
        farm.run()
        farm.idle()
        farm.change("1_1", trouble="the disk is full")
        plans = list(snapshots(farm, 1, 10))
        assert [plan.drain for plan in plans].count(("1_1",)) == 1
        assert [plan.end for plan in plans].count(("1_1",)) == 1
        submits = [plan.submit for plan in plans]
        assert sum(submits) == 1
        ended = [plan.end for plan in plans].index(("1_1",))
        assert submits.index(1) > ended
