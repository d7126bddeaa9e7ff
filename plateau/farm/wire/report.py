"""A job's report: everything about it on one self-contained page.

The page has no script and loads nothing: images are embedded, the curve is a drawing, and every
string from a scene or a user is escaped. So it can be kept with the image, mailed and cited.
"""

import base64
import json
from collections.abc import Iterable, Mapping
from html import escape
from pathlib import Path
from typing import Final

from plateau.farm.model.job import CurvePoint, Event, Job, utc_now
from plateau.farm.model.states import JobState
from plateau.farm.wire import figures
from plateau.farm.wire.curve_svg import job_svg

#: The style that a report carries.
STYLE: Final = Path(__file__).with_name("report.css").read_text("utf-8")

#: Captions by the names of the pictures that a report shows.
CAPTIONS: Final = {
    "image.png": "The merged image, as the job's display shows it.",
    "difference.png": "Orange: changed since the first image of the curve, as a person sees it.",
    "noise.png": "Orange: noise that is left to see; darker, where it is as likely as not.",
    "quality.png": "Where a person would see the noise, by ColorVideoVDP: from dark blue, nowhere, "
    "to yellow, as much as 3 JOD and more.",
    "spp.png": "From dark blue to yellow: zones with few samples, and with many.",
    "non-finite.png": "Magenta: pixels that are NaN; blue: infinite ones.",
}


def report_html(
    job: Job,
    points: list[CurvePoint],
    events: Iterable[Event],
    pictures: Mapping[str, bytes | None],
) -> str:
    """The report as an HTML document.

    `pictures` has the PNG files that exist, by name; None stands for a damaged one.
    """
    name = escape(job.name)
    # Readers of the report need not know whom the farm notifies.
    spec = job.spec.model_dump(mode="json", exclude={"notice"})
    return f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{name}: {job.outcome} at {job.spp:,} spp</title><style>{STYLE}</style></head><body>
<h1>{name}</h1>
<p class="dim">{job.outcome} at {job.spp:,} spp · job {job.id} · Plateau</p>
<p class="lead">{_sentence(job.reason)}</p>
{_pictures(pictures)}
<h2>The curve</h2>{job_svg(job, points) if points else "<p>It has no point.</p>"}
<h2>Figures</h2>{_facts(job)}
<h2>Points</h2>{_points(points)}
<h2>Story</h2><ul>{_story(events)}</ul>
<h2>What was asked</h2><pre>{escape(json.dumps(spec, indent=2))}</pre>
</body></html>
"""


def curve_file(job: Job, points: list[CurvePoint]) -> str:
    """The drawing of a curve of at least one point as a file of its own."""
    return job_svg(job, points, style=STYLE)


def _sentence(text: str) -> str:
    return escape(f"{text[:1].upper()}{text[1:]}".rstrip(".") + ".")


def _pictures(pictures: Mapping[str, bytes | None]) -> str:
    figures = "".join(
        _picture(name, caption, pictures[name])
        for name, caption in CAPTIONS.items()
        if name in pictures
    )
    return f'<div class="pictures">{figures}</div>'


def _picture(name: str, caption: str, content: bytes | None) -> str:
    if content is None:
        return f"<p>{name} is damaged in the farm's store, and is left out.</p>"
    source = f"data:image/png;base64,{base64.b64encode(content).decode()}"
    return (
        f'<figure><img alt="{escape(caption)}" src="{source}">'
        f"<figcaption>{escape(caption)}</figcaption></figure>"
    )


def _facts(job: Job) -> str:
    size = f"{job.width} × {job.height} pixels" if job.width else "not known"
    rows = {
        "Image": f"{size}, {job.variant or 'not rendered'}",
        "Scene": f"{job.name}, SHA-256 {job.scene_sha256}",
        "Samples": f"{job.spp:,} of at most {job.spec.max_spp:,} spp",
        "Time": figures.duration(job.duration_s(utc_now())),
        "Machine time": figures.duration(job.machine_s),
        "Submitted": f"{job.created_at:%Y-%m-%d %H:%M:%S} UTC",
    }
    if in_zones := figures.spp_range(job.spp_min, job.spp_max):
        rows["Zones"] = in_zones
    if job.samples_saved:
        share = f"{figures.share(job.saved_fraction)} of the cap"
        rows["Saved"] = f"{share}, {job.samples_saved:,} samples"
    if job.estimate_pixels is not None and job.estimate_fraction is not None:
        left = f"{figures.pixels(job.estimate_pixels)} pixels"
        rows["Noise left"] = (
            f"{left} ({figures.percent(job.estimate_fraction)}) still differ visibly from the "
            "converged image, by the half-buffer estimate"
        )
        if job.estimate_undetermined:
            rows["Noise left"] += ". It is undetermined: it may be more than twice as much"
    if job.non_finite_pixels:
        rows["Broken"] = (
            f"{job.non_finite_pixels:,} pixels are NaN or infinite, and left out of what is counted"
        )
    if job.ended_at is not None:
        rows["Ended"] = f"{job.ended_at:%Y-%m-%d %H:%M:%S} UTC"
    for number, note in enumerate(job.notes, 1):
        rows[f"Note {number}"] = note
    cells = "".join(
        f'<tr><th scope="row">{name}</th><td>{escape(text)}</td></tr>'
        for name, text in rows.items()
    )
    return f'<table class="facts">{cells}</table>'


def _points(points: list[CurvePoint]) -> str:
    names = ("spp", "changed", "slope", "noise left", "between", "forecast")
    head = "".join(f'<th scope="col">{name}</th>' for name in names)
    rows = "".join(
        f'<tr><th scope="row">{point.spp:,}</th><td>{point.visible_pixels:,}</td>'
        f"<td>{_number(point.slope)}</td><td>{_pixels(point.estimate_pixels)}"
        f"{', undetermined' if point.estimate_undetermined else ''}</td>"
        f"<td>{_band(point.estimate_low_pixels, point.estimate_high_pixels)}</td>"
        f"<td>{_number(point.forecast_spp)}</td></tr>"
        for point in points
    )
    return f'<div class="scroll"><table><tr>{head}</tr>{rows}</table></div>'


def _band(low: float | None, high: float | None) -> str:
    return "–" if low is None or high is None else f"{_pixels(low)} – {_pixels(high)}"


def _number(value: float | None) -> str:
    return "–" if value is None else figures.significant(value)


def _pixels(count: float | None) -> str:
    return "–" if count is None else figures.pixels(count)


def _story(events: Iterable[Event]) -> str:
    return "".join(
        f"<li>{event.at:%Y-%m-%d %H:%M:%S} UTC: {_told(event)}</li>"
        for event in events
        if event.type in {"state", "trouble"}
    )


def _told(event: Event) -> str:
    data = event.data
    if event.type == "trouble":
        return escape(f"slice {data['index']}, worker {data['worker']}: {data['cause']}")
    state = JobState(data["to"]).in_words
    return f"<b>{state}</b>: {escape(str(data['reason']))}"
