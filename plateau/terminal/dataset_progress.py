"""Progress of a data set: a line that changes in place, or a line now and then elsewhere."""

import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Final

from rich.console import Console
from rich.live import Live

from plateau.farm.wire import figures
from plateau.terminal.progress import progress_bar

_EVERY_S: Final = 10.0  #: between two lines where none changes in place


@dataclass
class Course:
    """How far a run is."""

    total: int  #: images of the recipe
    there: int  #: that were there before
    states: Counter[str] = field(default_factory=Counter)  #: of those that this run has rendered
    began_s: float = field(default_factory=time.monotonic)

    @property
    def done(self) -> int:
        """The images that are there, or have failed in this run."""
        return self.there + self.states.total()

    @property
    def rate(self) -> float | None:
        """Images in a second; None before the first."""
        seconds = time.monotonic() - self.began_s
        return self.states.total() / seconds if self.states and seconds > 0 else None


@contextmanager
def dataset_progress_on(console: Console) -> Iterator[Callable[[Course], None]]:
    """A function that shows how far a run is; the last state stays on the console."""
    if console.is_terminal and not console.is_dumb_terminal:
        with Live(console=console, auto_refresh=False) as live:
            yield lambda course: live.update(
                progress_bar(course.total, course.done, *_words(course)), refresh=True
            )
        return
    shown_at, said = -_EVERY_S, -1

    def show(course: Course) -> None:
        nonlocal shown_at, said
        now = time.monotonic()
        is_end = course.done == course.total
        if course.done != said and (is_end or now >= shown_at + _EVERY_S):
            shown_at, said = now, course.done
            line = "  ".join(filter(None, _words(course)))
            console.print(line, markup=False, highlight=False, soft_wrap=True)

    yield show


def _words(course: Course) -> tuple[str, str]:
    done = f"{course.done:,} of {course.total:,} images"
    if failed := course.states["failed"]:
        done += f", {failed:,} failed"
    rate = "" if course.rate is None else f"{60 * course.rate:,.3g} a minute"
    left_s = (course.total - course.done) / course.rate if course.rate else 0.0
    left = f"about {figures.roughly(left_s)} left" if left_s else ""
    return done, "  ".join(filter(None, (rate, left)))
