"""Progress of a batch: live on a terminal, a line for each change elsewhere."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Final

from rich.console import Console, Group
from rich.live import Live
from rich.text import Text

from plateau.farm.model.job import utc_now
from plateau.farm.model.states import JobState
from plateau.farm.wire import figures
from plateau.farm.wire.batch_views import BatchView
from plateau.terminal.progress import progress_bar

#: What is said of several jobs, where it is not their state's name.
_COUNTED: Final = {JobState.EXHAUSTED: "reached their limit"}

#: Shows the current state of a batch.
Show = Callable[[BatchView], None]


@contextmanager
def batch_progress_on(console: Console) -> Iterator[Show]:
    """A function that shows the batch: lines that change in place, or a line for each change.

    The last lines stay on the console.
    """
    if console.is_terminal and not console.is_dumb_terminal:
        with Live(console=console, auto_refresh=False) as live:
            yield lambda batch: live.update(_lines(batch), refresh=True)
    else:
        yield _on_lines(console)


def _on_lines(console: Console) -> Show:
    shown: tuple[dict[JobState, int], str] = {}, ""

    def show(batch: BatchView) -> None:
        nonlocal shown
        now = batch.states, _shot(batch)
        if now != shown:
            shown = now
            line = "  ".join(filter(None, (in_states(batch.states), _shot(batch), _left(batch))))
            console.print(line, markup=False, highlight=False, soft_wrap=True)

    return show


def in_states(states: Mapping[JobState, int]) -> str:
    """The number of jobs in each state, in the order of a job's states."""
    counts = {_COUNTED.get(one, one.value): states[one] for one in JobState if one in states}
    return ", ".join(f"{count:,} {words}" for words, count in counts.items())


def _lines(batch: BatchView) -> Group:
    ended = sum(count for state, count in batch.states.items() if state.ended)
    done = f"{ended:,} of {batch.jobs:,} jobs"
    bar = progress_bar(batch.jobs, ended, done, _left(batch))
    state = in_states(batch.states)
    if shot := _shot(batch):
        state += f"   {shot}"
    return Group(Text.assemble((batch.name, "bold"), f"  {state}"), bar)


def _shot(batch: BatchView) -> str:
    """How good the shot was when it was judged last; "" of one that was not."""
    if batch.shot is None or batch.shot.jod is None:
        return ""
    return f"shot {batch.shot.jod:.2f} JOD, at worst {batch.shot.low_moment_jod:.2f}"


def _left(batch: BatchView) -> str:
    """The time that the batch still needs; "" if unknown."""
    if batch.forecast_end_at is None:
        return ""
    seconds = (batch.forecast_end_at - utc_now()).total_seconds()
    return f"about {figures.roughly(max(0.0, seconds))} left"
