"""Figures in words, as progress and summaries show them."""

import math
from datetime import datetime
from typing import Final

from farm.job import CurvePoint, Job
from farm.spec import ReverseSpec, VisibleSpec

_MINUTE_S: Final = 60
_HOUR_S: Final = 3600


def duration(seconds: float) -> str:
    """Seconds as people say them: ``4.2 s``, ``3 min 20 s``, ``2 h 05 min``."""
    if seconds < _MINUTE_S - 0.05:
        return f"{seconds:.1f} s"
    whole = round(seconds)
    if whole < _HOUR_S:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60:02d} min"


def percent(fraction: float) -> str:
    """A fraction as a percentage, rounded down: it says 100 only where it is."""
    tenths = math.floor(fraction * 1000 + 1e-9)
    return f"{tenths // 10} %" if tenths % 10 == 0 else f"{tenths / 10:.1f} %"


def pixels(count: float | None, fraction: float | None) -> str:
    """A number of pixels and its share of the image."""
    if count is None or fraction is None:
        return "–"
    number = f"{count:,.0f}" if count >= 10 else f"{count:.2g}"  # an estimate may be half a pixel
    return f"{number} px ({100 * fraction:.3g} %)"


def significant(value: float) -> str:
    """A number with three significant digits or, where it is large, all of its whole ones."""
    return f"{value:,.0f}" if abs(value) >= 100 else f"{value:.3g}"


def size(count: float) -> str:
    """A number of bytes as people say it: ``512 bytes``, ``1.4 MB``."""
    for unit in ("bytes", "kB", "MB"):
        if count < 1000:
            return f"{count:.0f} {unit}" if unit == "bytes" else f"{count:.1f} {unit}"
        count /= 1000
    return f"{count:,.1f} GB"


def figures(job: Job, point: CurvePoint) -> list[str]:
    """Visible pixels, slope, estimate, forecast and broken pixels of a point, where known."""
    found = [f"visible {pixels(point.visible_pixels, point.visible_fraction)}"]
    if point.slope is not None:
        stop = stop_slope(job)
        aim = "" if stop is None else f" (stops at {significant(stop)})"
        found.append(f"slope {significant(point.slope)} px/spp{aim}")
    if point.estimate_pixels is not None:
        left = pixels(point.estimate_pixels, point.estimate_fraction)
        target = stop_fraction(job)
        aim = "" if target is None else f" (stops at {100 * target:g} %)"
        found.append(f"estimate {left}{aim}")
    if point.forecast_spp is not None and not job.state.ended:
        found.append(f"forecast {point.forecast_spp:,} spp")
    if point.non_finite_pixels:
        found.append(f"broken {point.non_finite_pixels:,} px")
    return found


def point_line(job: Job, point: CurvePoint, *more: str) -> str:
    """A point of the curve in a line, with more at its end."""
    return f"{point.spp:>6} spp  {'  '.join(filter(None, (*figures(job, point), *more)))}"


def rule_window(job: Job) -> int:
    """How many points of the curve the slope is taken over."""
    reverse = [rule for rule in (job.spec.rule, *job.spec.watch) if isinstance(rule, ReverseSpec)]
    return (reverse[0] if reverse else ReverseSpec()).window


def stop_slope(job: Job) -> float | None:
    """The slope at which the job's rule stops, in visible pixels per spp of its own image."""
    if not isinstance(job.spec.rule, ReverseSpec) or job.width is None or job.height is None:
        return None
    from metric.rules.reverse import EPSILON_PIXELS  # with numpy: for those alone who ask

    return job.spec.rule.epsilon * job.width * job.height / EPSILON_PIXELS


def stop_fraction(job: Job) -> float | None:
    """The share of visibly wrong pixels at which the job's rule stops."""
    return job.spec.rule.target if isinstance(job.spec.rule, VisibleSpec) else None


def wall_s(job: Job, now: datetime | None = None) -> float:
    """Seconds from the job's creation until its results were written, or until now."""
    end = job.finished_at or job.ended_at or now
    return (end - job.created_at).total_seconds() if end else 0.0


def pauses(job: Job) -> str:
    """For how long the job was paused, and since when it is."""
    before = f"for {duration(job.paused_s)}" if job.paused_s else ""
    now = f"since {job.paused_at:%Y-%m-%d %H:%M:%S} UTC" if job.paused_at else ""
    return ", and ".join(filter(None, (before, now)))


def summary(job: Job, waits_for: str | None = None) -> str:
    """What became of a job, in a few lines; `waits_for` says what it waits for, where it does."""
    rows = [("state", job.state.value), ("reason", job.reason)]
    if waits_for:
        rows.append(("workers", f"it {waits_for}"))
    if job.width is not None:
        rows.append(("image", f"{job.width}×{job.height}, {job.variant}, scene {job.name}"))
    share = job.spp / job.spec.max_spp
    rows.append(("samples", f"{job.spp:,} of at most {job.spec.max_spp:,} spp ({percent(share)})"))
    if job.samples_saved:
        saved = f"{percent(job.saved_fraction)} of the cap, {job.samples_saved:,} samples"
        rows.append(("saved", saved))
    if job.visible_pixels is not None:
        seen = pixels(job.visible_pixels, job.visible_fraction)
        rows.append(("visible", f"{seen} differ visibly from the first image of the curve"))
    if job.estimate_pixels is not None:
        left = pixels(job.estimate_pixels, job.estimate_fraction)
        rows.append(
            ("left", f"{left} still differ visibly from the converged image, by half buffers")
        )
    if job.non_finite_pixels:
        total = (job.width or 0) * (job.height or 0)
        broken = pixels(job.non_finite_pixels, job.non_finite_pixels / total)
        rows.append(("broken", f"{broken} are NaN or infinite, and left out of what is counted"))
    rows.append(("time", f"{duration(wall_s(job))}; machine time {duration(job.machine_s)}"))
    if job.paused_at is not None or job.paused_s:
        rows.append(("paused", pauses(job)))
    rows += [("note", note) for note in job.notes]
    return "\n".join(f"{name + ':':<9}{text}" for name, text in rows)
