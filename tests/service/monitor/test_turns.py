"""Every job of a monitor has its turn: those of a hint at once, the others in rounds."""

from collections import Counter

from hypothesis import given, settings
from hypothesis import strategies as st

from plateau.service.monitor.turns import (
    IDLE_S,
    LEFT_S,
    LONGEST_IDLE_S,
    RETRY_S,
    ROUND_S,
    Share,
    Turns,
)


class Clock:
    """A clock that a test moves."""

    def __init__(self) -> None:
        self.now_s = 0.0

    def __call__(self) -> float:
        return self.now_s


class Looking:
    """A monitor that looks at its jobs again and again; each turn takes a while."""

    def __init__(self, jobs: int, turn_s: float) -> None:
        self.clock = Clock()
        self.turns = Turns(self.clock)
        self.owned = {str(number): turn_s for number in range(jobs)}
        for job_id in self.owned:
            self.turns.add(job_id)

    def look(self, *hinted: str) -> list[str]:
        """The jobs that had a turn, in order."""
        found = []
        for job_id in self.turns.next_jobs(self.owned, hinted):
            found.append(job_id)
            self.clock.now_s += self.owned[job_id]
        return found

    def wait(self) -> None:
        self.clock.now_s += self.turns.wait_s


def test_what_was_just_taken_need_not_wait_for_a_round() -> None:
    looking = Looking(2, turn_s=0.001)
    looking.look()
    looking.owned["new"] = 0.001
    looking.turns.add("new")
    assert looking.turns.wait_s == 0
    assert looking.look() == ["new"]
    assert looking.turns.wait_s == IDLE_S


def test_a_long_round_is_interrupted_and_continued() -> None:
    # Given a thousand jobs, which take five seconds together
    looking = Looking(1000, turn_s=0.005)
    looking.look()
    assert looking.turns.wait_s == 0  # a hint is asked for in between
    began = looking.clock.now_s
    assert looking.look("999")[0] == "999"
    assert looking.clock.now_s - began <= ROUND_S + 2 * 0.005
    # When a round is over, the next is put off, but not for long
    while looking.turns.wait_s == 0:
        looking.look()
    pauses = 0.0
    while not looking.look():
        looking.wait()
        pauses += IDLE_S
    assert pauses == LONGEST_IDLE_S


def test_a_job_that_lacks_something_is_left_alone_for_longer_each_time() -> None:
    looking = Looking(2, turn_s=0.0)
    waits = []
    for _ in range(8):
        looking.turns.put_off("0")
        began = looking.clock.now_s
        while "0" not in looking.look("0", "1"):
            looking.clock.now_s += 0.01
        waits.append(looking.clock.now_s - began)
    first_s, longest_s = RETRY_S
    assert waits[0] < 1.5 * first_s + 0.02
    assert longest_s / 2 <= waits[-1] < 1.5 * longest_s + 0.02
    # Until it lacks nothing
    looking.turns.put_off("0")
    looking.turns.note_success("0")
    assert looking.look("0") == ["0"]


@settings(deadline=None)
@given(
    st.integers(1, 40),
    st.sampled_from([0.0, 0.01, 0.2]),
    st.lists(st.sets(st.integers(0, 39)), max_size=5),
)
def test_every_job_has_a_turn_however_many_hints_there_are(
    jobs: int, turn_s: float, hints: list[set[int]]
) -> None:
    looking = Looking(jobs, turn_s)
    had: Counter[str] = Counter()
    for number in range(3 * jobs + 20):
        hinted = hints[number % len(hints)] if hints else set()
        found = looking.look(*map(str, hinted))
        # Each hint is served at once
        assert [one for one in looking.owned if int(one) in hinted] == found[
            : len(hinted & set(range(jobs)))
        ]
        had.update(found)
        looking.wait()
    assert set(had) == set(looking.owned)


def test_a_monitor_takes_its_share_and_what_the_others_leave() -> None:
    clock, owned = Clock(), ["mine"]
    share = Share(clock)

    def take(*free: str, jobs: int, monitors: int) -> None:
        for job_id in share.jobs_to_take(free, owned, jobs=jobs, monitors=monitors):
            owned.append(job_id)  # noqa: PERF402  (the share looks at it meanwhile)

    # Given two monitors and six jobs, three of which are free and two of which the other one has
    take("a", "b", "c", jobs=6, monitors=2)
    assert owned == ["mine", "a", "b"]
    # What is left is taken when the other monitor did not take it within a moment
    clock.now_s += LEFT_S / 2
    take("c", "d", jobs=7, monitors=2)
    assert owned == ["mine", "a", "b", "c"]  # of seven, four are a share
    take("d", "e", jobs=8, monitors=2)
    assert owned == ["mine", "a", "b", "c"]
    clock.now_s += LEFT_S
    take("d", "e", "f", jobs=9, monitors=2)
    assert owned == ["mine", "a", "b", "c", "d", "e"]
    # One that is alone takes all at once
    take("f", "g", jobs=8, monitors=1)
    assert owned[-2:] == ["f", "g"]
