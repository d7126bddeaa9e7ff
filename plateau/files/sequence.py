"""The frames of a batch: which of its jobs show the same, and in which order they play."""

from collections.abc import Iterable, Mapping, Sequence

from plateau.farm.wire.views import JobView


def what_it_shows(job: JobView) -> Mapping[str, object]:
    """What tells the frame of a job from others.

    Parameters are as Mitsuba reads them: 1 and "1" are one frame.
    """
    return {**job.spec.parameter_strings(), "name": job.name, "sensor": job.spec.sensor}


def frames_of(jobs: Iterable[JobView]) -> list[JobView]:
    """Return the newest job of each frame, in the order in which frames play.

    Parameters
    ----------
    jobs : iterable of JobView
        A batch's, in their order. A later job that shows the same is the frame rendered again.

    Returns
    -------
    list of JobView
        By the parameter that alone tells them apart, if all its values are numbers; otherwise in
        the order of their first jobs.
    """
    newest: dict[tuple[tuple[str, object], ...], JobView] = {}
    for job in jobs:
        newest[tuple(sorted(what_it_shows(job).items()))] = job
    frames = list(newest.values())
    numbers = _numbers(frames)
    return [frames[place] for place in sorted(range(len(frames)), key=numbers.__getitem__)]


def _numbers(frames: Sequence[JobView]) -> Sequence[float]:
    """The value of each frame for the one parameter in which they differ, or its place."""
    shown = [what_it_shows(frame) for frame in frames]
    names = {name for one in shown for name in one}
    differing = [name for name in names if len({one.get(name) for one in shown}) > 1]
    if len(differing) == 1:
        try:
            return [float(str(one[differing[0]])) for one in shown]
        except (KeyError, ValueError):
            pass
    return range(len(frames))
