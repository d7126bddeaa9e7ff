"""A job and its curve as text, for progress and summaries."""

from datetime import datetime
from typing import Any

from plateau.farm.model.job import NONE_LEFT, CurvePoint, Job, Notice, utc_now
from plateau.farm.model.spec import JobSpec
from plateau.farm.wire.figures import (
    duration,
    percent,
    pixels,
    share,
    significant,
    spp_range,
)
from plateau.farm.wire.views import JobView
from plateau.rules import StoppingRule


def row(name: str, text: str) -> str:
    """A line of a summary."""
    return f"{name + ':':<12}{text}"


def of_image(count: float | None, fraction: float | None) -> str:
    """A number of pixels and its share of the image."""
    if count is None or fraction is None:
        return "–"
    return f"{pixels(count)} px ({percent(fraction)})"


def size(count: float) -> str:
    """A number of bytes for people: ``512 bytes``, ``1.4 MB``."""
    for unit in ("bytes", "kB", "MB"):
        if count < 1000:
            return f"{count:.0f} {unit}" if unit == "bytes" else f"{count:.1f} {unit}"
        count /= 1000
    return f"{count:,.1f} GB"


def share_of(part: float, whole: float) -> str:
    """Bytes of more bytes: ``9.1 of 33.6 GB``."""
    used, all_of_it = size(part), size(whole)
    unit = all_of_it.rpartition(" ")[2]
    return f"{used.removesuffix(f' {unit}')} of {all_of_it}"


def point_figures(job: Job, point: CurvePoint) -> list[str]:
    """The known figures of a point.

    They are the samples of its zones, changed pixels, slope, noise left, forecast, broken pixels.
    """
    in_zones = spp_range(point.spp_min, point.spp_max)
    found = [f"zones {in_zones}"] if in_zones else []
    found.append(f"changed {of_image(point.visible_pixels, point.visible_fraction)}")
    if point.slope is not None:
        stop = stop_slope(job)
        aim = "" if stop is None else f" (stops at {significant(stop)})"
        found.append(f"slope {significant(point.slope)} px/spp{aim}")
    if point.estimate_pixels is not None:
        left = of_image(point.estimate_pixels, point.estimate_fraction)
        target = job.spec.rule.behaviour.noise_target
        aim = "" if target is None else f" (stops at {100 * target:g} %)"
        found.append(f"noise left {left}{aim}{undetermined(point)}")
    found += _own_values(job, point)
    if point.expected_spp is not None and not job.state.ended:
        found.append(f"forecast {point.expected_spp:,} spp")
    if point.non_finite_pixels:
        found.append(f"broken {point.non_finite_pixels:,} px")
    return found


def _own_values(job: Job, point: CurvePoint) -> list[str]:
    """The values of the job's rules that have a quantity of their own, such as a quality."""
    found = []
    for spec in (job.spec.rule, *job.spec.watch):
        rule, said = spec.behaviour, point.rules.get(spec.name)
        if rule.quantity and said is not None and said.value is not None:
            stops = "stops" if spec is job.spec.rule else "would stop"
            aim = "" if rule.value_target is None else f" ({stops} at {rule.value_target:g})"
            found.append(f"{rule.quantity} {significant(said.value)} {rule.unit}{aim}")
    return found


def undetermined(judged: Job | CurvePoint) -> str:
    """That the noise left may be far more, to be put behind it; nothing if that is not so."""
    return ", undetermined" if judged.estimate_undetermined else ""


def point_line(job: Job, point: CurvePoint, *more: str) -> str:
    """A point of the curve on one line, with `more` at its end."""
    return f"{point.spp:>6} spp  {'  '.join(filter(None, (*point_figures(job, point), *more)))}"


def valued_rule(spec: JobSpec) -> StoppingRule | None:
    """The first of the job's rules whose value is a quantity of its own, such as a quality."""
    rules = (one.behaviour for one in (spec.rule, *spec.watch))
    return next((rule for rule in rules if rule.quantity), None)


def stop_slope(job: Job) -> float | None:
    """The slope at which the job's rule stops, in changed pixels per spp of the job's image."""
    limit = job.spec.rule.behaviour.slope_limit
    if limit is None or job.width is None or job.height is None:
        return None
    return limit.of(job.width * job.height)


def again(job: Job) -> str:
    """What a job has of the ended one that it renders again; "" of any other."""
    if job.again is None:
        return ""
    if job.again.kept_spp:
        return f"keeps {job.again.kept_spp:,} spp of job {job.again.of}"
    why = f"with this {job.again.why} its samples cannot be kept"
    if job.again.why == NONE_LEFT:
        why = "none of its samples are left"
    return f"renders job {job.again.of} anew: {why}"


def pauses(job: Job) -> str:
    """For how long the job was paused before, and since when it is paused now."""
    before = f"for {duration(job.paused_s)}" if job.paused_s else ""
    now = f"since {job.paused_at:%Y-%m-%d %H:%M:%S} UTC" if job.paused_at else ""
    return ", and ".join(filter(None, (before, now)))


def of_notice(notice: Notice) -> str:
    """How a notice stands that is not delivered."""
    words = "given up" if notice.state == "given-up" else "not delivered yet"
    why = f": {notice.error}" if notice.error else ""
    return f"to {notice.to}, {words} at {notice.at:%Y-%m-%d %H:%M:%S} UTC{why}"


def _cost(job: Job) -> str:
    """The core hours of a job, and of what its stop saved."""
    spent = f"{significant(job.core_hours)} core hours"
    if not job.samples_saved:
        return spent
    return f"{spent}; the stop saved about {significant(job.saved_core_hours)} core hours"


def summary(job: JobView, now: datetime) -> str:
    """A job in a few lines."""
    rows = [("state", job.outcome), ("reason", job.reason)]
    if not job.state.ended:
        if job.waits_for and job.waits_for != job.reason:  # otherwise the reason says it
            rows.append(("workers", f"it {job.waits_for}"))
        elif job.fitting_workers:
            rows.append(("workers", f"{job.fitting_workers} can render it"))
    if job.again is not None:
        rows.append(("again", f"it {again(job)}"))
    if job.width is not None:
        denoised = ", denoised" if job.spec.is_denoised else ""
        image = f"{job.width}×{job.height}, {job.variant}, {job.title}{denoised}"
        rows += [("image", image), ("judged", f"as seen {job.seen}; samples {job.sampled}")]
    samples = f"{job.spp:,} of at most {job.spec.max_spp:,} spp"
    if job.samples_saved:  # one share of the cap is enough
        saved = f"{share(job.saved_fraction)} of the cap, {job.samples_saved:,} samples"
        rows += [("samples", samples), ("saved", saved)]
    else:
        rows.append(("samples", f"{samples} ({share(job.spp / job.spec.max_spp)})"))
    if in_zones := spp_range(job.spp_min, job.spp_max):
        rows.append(("zones", in_zones))
    if job.visible_pixels is not None:
        changed = of_image(job.visible_pixels, job.visible_fraction)
        rows.append(("changed", f"{changed} differ visibly from the first image of the curve"))
    if job.estimate_pixels is not None:
        left = of_image(job.estimate_pixels, job.estimate_fraction)
        by = "bias included" if job.spec.is_denoised else "by half buffers"
        words = f"{left} still differ visibly from the converged image, {by}{undetermined(job)}"
        rows.append(("noise left", words))
    if job.non_finite_pixels:
        total = (job.width or 0) * (job.height or 0)
        broken = of_image(job.non_finite_pixels, job.non_finite_pixels / total)
        rows.append(("broken", f"{broken} are NaN or infinite, and left out of what is counted"))
    rows.append(
        ("time", f"{duration(job.duration_s(now))}; machine time {duration(job.machine_s)}")
    )
    if job.core_hours:
        rows.append(("cost", _cost(job)))
    if job.time_left:
        forecast = "" if job.expected_spp is None else f", forecast {job.expected_spp:,} spp"
        rows.append(("to come", f"{job.time_left}{forecast}"))
    if job.paused_at is not None or job.paused_s:
        rows.append(("paused", pauses(job)))
    if job.deleted_at is not None:
        undo = f"`plateau delete --undo {job.id}` undoes it for a while"
        rows.append(("deleted", f"since {job.deleted_at:%Y-%m-%d %H:%M:%S} UTC; {undo}"))
    rows += [("note", note) for note in job.notes]
    return "\n".join(row(name, text) for name, text in rows)


def summary_json(job: JobView, points: list[CurvePoint], files: list[str]) -> dict[str, Any]:
    """The job, its curve, how much it saved and the names of its files, as JSON values."""
    return {
        **job.model_dump(mode="json"),
        "wall_s": job.duration_s(utc_now()),
        "curve": [point.model_dump(mode="json") for point in points],
        "files": files,
    }
