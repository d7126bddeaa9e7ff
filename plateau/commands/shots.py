"""`plateau shot`: a batch as the video that it is."""

from plateau.commands.connect import connect
from plateau.farm.model.shot import Shot
from plateau.farm.wire import job_text
from plateau.farm.wire.shot_views import ShotView
from plateau.terminal.tables import print_rows

_COLUMNS = ("frame", "job", "state", "spp", "asked for", "JOD then")


def show(name: str, *, url: str | None, as_json: bool) -> None:
    """Print the newest shot of a batch, frame by frame."""
    with connect(url) as client:
        found = client.shot(name)
    if as_json:
        print(found.model_dump_json(indent=2))
        return
    print(job_text.row("shot", said(found)))
    if found.why:
        print(job_text.row("judged", found.why))
    print_rows(_COLUMNS, _rows(found), none="no frames")


def said(shot: Shot) -> str:
    """Return a shot in a line."""
    words = f"{shot.frames:,} frames at {shot.fps:g} per second, {shot.state}"
    if shot.state in {"rendering", "judging"}:
        words += f": {shot.waiting:,} of them wait"
    if shot.jod is not None and shot.low_moment_jod is not None:
        words += f"; {shot.jod:.2f} JOD, at its worst moment {shot.low_moment_jod:.2f}"
        words += f" (frame {shot.worst_frame})"
    return words if shot.target is None else f"{words}; to be {shot.target:g}"


def _rows(shot: ShotView) -> list[tuple[str, ...]]:
    last = shot.judged[-1] if shot.judged else None
    return [
        (
            str(place),
            frame.job,
            "waits" if frame.waits else "deleted" if frame.state is None else frame.state.in_words,
            f"{frame.spp:,}",
            "" if frame.needs_spp is None else f"{frame.needs_spp:,}",
            "" if last is None else f"{last.low_frames[place]:.2f}",
        )
        for place, frame in enumerate(shot.by_frame)
    ]
