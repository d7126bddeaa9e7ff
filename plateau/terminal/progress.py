"""Progress of a job: live on a terminal, a line for each point of the curve elsewhere."""

from collections import deque
from datetime import datetime
from typing import Final

from rich.console import Console, Group
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from plateau.farm.model.job import CurvePoint, Event, utc_now
from plateau.farm.model.states import JobState
from plateau.farm.wire import figures, job_text
from plateau.farm.wire.views import JobView
from plateau.terminal.curve import LEAST_COLUMNS, LEAST_ROWS, terminal_curve

#: The render rate is that of the slices of the last seconds.
_RATE_S: Final = 20.0
#: Lines of the curve, if the terminal has room for them and for the other lines.
_CURVE_ROWS: Final = 12
_OTHER_ROWS: Final = 8


class Progress:
    """Shows a job while it runs; a context that lasts until the job has ended.

    This one shows nothing.
    """

    def __init__(self) -> None:
        self._job: JobView | None = None
        self._points: list[CurvePoint] = []
        self._slices: deque[tuple[datetime, int]] = deque()  # when committed, and its samples

    def __enter__(self) -> "Progress":
        return self

    def __exit__(self, *error: object) -> None:
        self.refresh()

    def job(self, job: JobView) -> None:
        """Show the current state of the job, and each of its notes once."""
        known = () if self._job is None else self._job.notes
        self._job = job
        for note in job.notes:
            if note not in known:
                self.note(f"note: {note}")
        self.refresh()

    def event(self, event: Event) -> None:
        """Record an event of the job."""
        if event.type == "slice":
            self._slices.append((event.at, int(str(event.data.get("samples", 0)))))
            while (event.at - self._slices[0][0]).total_seconds() > _RATE_S:
                self._slices.popleft()
        elif event.type == "point":
            self._points.append(CurvePoint.model_validate(event.data))

    def note(self, text: str) -> None:
        """Show a line that stays."""

    def refresh(self) -> None:
        """Show the passing time."""

    def _rate(self, job: JobView) -> str:
        """The render rate over the last slices; "" if unknown."""
        if len(self._slices) < 2 or job.state is JobState.PAUSED:
            return ""
        (first, _), *later = self._slices
        seconds = (later[-1][0] - first).total_seconds()
        samples = sum(of_slice for _, of_slice in later)
        return f"{samples / seconds / 1e6:.2f} Msamples/s" if seconds > 0 else ""


class PlainProgress(Progress):
    """A line for each change of state and each point of the curve."""

    def __init__(self, console: Console) -> None:
        super().__init__()
        self._console = console
        self._shown_state = ""

    def note(self, text: str) -> None:
        """Print a line."""
        self._console.print(text, markup=False, highlight=False, soft_wrap=True)

    def job(self, job: JobView) -> None:
        """Print a new state."""
        super().job(job)
        if job.state.value != self._shown_state and not job.state.ended:
            to_come = job.time_left if job.state is JobState.QUEUED else ""
            self.note(f"{job.state.value}: {'; '.join(filter(None, (job.reason, to_come)))}")
            self._shown_state = job.state.value

    def event(self, event: Event) -> None:
        """Print a new point of the curve."""
        super().event(event)
        if event.type == "point" and self._job is not None:
            point = self._points[-1]
            after = figures.duration((point.at - self._job.created_at).total_seconds())
            self.note(job_text.point_line(self._job, point, self._rate(self._job), after))


class LiveProgress(Progress):
    """A few lines that change in place.

    With `curve` the curve is drawn, if the terminal has room for it; otherwise a row of bars.
    """

    def __init__(self, console: Console, *, curve: bool = True) -> None:
        super().__init__()
        self._curve = curve
        self._columns = console.width
        # No refresh thread: the process tree starts its processes from this one.
        self._live = Live(console=console, auto_refresh=False)

    def __enter__(self) -> "LiveProgress":
        self._live.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._live.stop()  # the last lines stay

    def note(self, text: str) -> None:
        """Print a line above the others."""
        self._live.console.print(text, markup=False, highlight=False)

    def refresh(self) -> None:
        """Draw the lines again."""
        console = self._live.console
        if console.width < self._columns:  # the terminal has wrapped the long lines
            console.clear()
        self._columns = console.width
        if self._job is not None:
            self._live.update(self._lines(self._job), refresh=True)

    def _lines(self, job: JobView) -> Group:
        size = "" if job.width is None else f" · {job.width}×{job.height}"
        variant = "" if job.variant is None else f" · {job.variant}"
        head = Table.grid(expand=True)
        head.add_column(ratio=1)
        head.add_column(justify="right")
        times = filter(None, (job.time_left, figures.duration(job.duration_s(utc_now()))))
        head.add_row(
            Text.assemble((job.name, "bold"), f"  {job.state.value}{variant}{size}"),
            " · ".join(times),
        )
        spp = max(job.spp, job.committed_spp) if not job.state.ended else job.spp
        cap = job.spec.max_spp
        bar = progress_bar(cap, spp, f"{spp:,} of at most {cap:,} spp", self._rate(job))
        lines: list[Table | Text] = [head, bar]
        if self._points:
            lines.append(Text("   ".join(job_text.point_figures(job, self._points[-1]))))
        elif job.state is not JobState.PAUSED:
            lines.append(Text(job.reason, style="dim"))
        if job.state is JobState.PAUSED:
            lines.append(Text(f"{job.reason}; `plateau resume {job.id}` resumes it", "yellow"))
        console = self._live.console
        rows = min(_CURVE_ROWS, console.height - _OTHER_ROWS)
        has_room = console.width >= LEAST_COLUMNS and rows >= LEAST_ROWS
        if (
            self._curve
            and has_room
            and len(self._points) > 1
            and console.encoding.startswith("utf")
        ):
            target = job.spec.rule.behaviour.noise_target
            lines.append(
                terminal_curve(self._points, target=target, columns=console.width, rows=rows)
            )
        return Group(*lines)


def progress_on(console: Console, *, curve: bool = True) -> Progress:
    """The progress for this console: live on a terminal, plain lines elsewhere."""
    if console.is_terminal and not console.is_dumb_terminal:
        return LiveProgress(console, curve=curve)
    return PlainProgress(console)


def progress_bar(total: int, completed: int, *notes: str) -> Table:
    """A bar with notes at its right; empty notes are left out."""
    bar = Table.grid(padding=(0, 2), expand=True)
    bar.add_column(ratio=1)
    bar.add_column(justify="right", no_wrap=True)
    bar.add_row(ProgressBar(total=total, completed=completed), "   ".join(filter(None, notes)))
    return bar
