"""Progress of a batch: live on a terminal, a line for each change elsewhere."""

from collections.abc import Mapping
from datetime import datetime, timezone
from types import TracebackType

from rich.console import Console, Group
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from farm.states import JobState
from plateau import words
from service.batch_views import BatchView


class PlainBatchProgress:
    """A line for each change of the jobs' states."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._said: dict[JobState, int] = {}

    def __enter__(self) -> "PlainBatchProgress":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Leave what was shown."""

    def batch(self, batch: BatchView) -> None:
        """Print a line where a job has moved."""
        if batch.states != self._said:
            self._said = batch.states
            line = "  ".join(filter(None, (in_states(batch.states), _left(batch))))
            self._console.print(line, markup=False, highlight=False, soft_wrap=True)


class LiveBatchProgress:
    """A few lines that change in place."""

    def __init__(self, console: Console) -> None:
        self._live = Live(console=console, auto_refresh=False)

    def __enter__(self) -> "LiveBatchProgress":
        self._live.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Leave the last lines where they are."""
        self._live.stop()

    def batch(self, batch: BatchView) -> None:
        """Draw the lines again."""
        self._live.update(_lines(batch), refresh=True)


def batch_progress_on(console: Console) -> PlainBatchProgress | LiveBatchProgress:
    """The progress that suits the console."""
    if console.is_terminal and not console.is_dumb_terminal:
        return LiveBatchProgress(console)
    return PlainBatchProgress(console)


def in_states(states: Mapping[JobState, int]) -> str:
    """How many jobs are in each state, in the order in which a job goes through them."""
    return ", ".join(f"{states[state]:,} {state.value}" for state in JobState if state in states)


def _lines(batch: BatchView) -> Group:
    ended = sum(count for state, count in batch.states.items() if state.ended)
    bar = Table.grid(padding=(0, 2), expand=True)
    bar.add_column(ratio=1)
    bar.add_column(justify="right", no_wrap=True)
    figures = filter(None, (f"{ended:,} of {batch.jobs:,} jobs", _left(batch)))
    bar.add_row(ProgressBar(total=batch.jobs, completed=ended), "   ".join(figures))
    state = in_states(batch.states)
    if not batch.guard.even:
        state += f"   not even: `plateau batch {batch.name}` says why"
    return Group(Text.assemble((batch.name, "bold"), f"  {state}"), bar)


def _left(batch: BatchView) -> str:
    """For how long it will go on, where that is known."""
    if batch.forecast_end_at is None:
        return ""
    seconds = (batch.forecast_end_at - datetime.now(timezone.utc)).total_seconds()
    return f"{words.duration(max(0.0, seconds))} left"
