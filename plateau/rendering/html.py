"""A job in a notebook's cell: its image, its curve and its figures, without scripts."""

import base64
import io
from html import escape
from typing import Final

from plateau.farm.model.job import CurvePoint, utc_now
from plateau.farm.wire import figures, job_text
from plateau.farm.wire.curve_svg import job_svg
from plateau.farm.wire.views import JobView

#: A notebook keeps what it shows, so large images are shown smaller.
_MOST_PIXELS: Final = 800

_STYLE: Final = """
.plateau{display:grid;grid-template-columns:minmax(0,1fr) minmax(0,1fr);gap:1rem;max-width:60rem;
--curve:#2a86a8;--estimate:#8a6cc4;--stop:#c9485c;line-height:1.4}
.plateau>p{grid-column:1/-1;margin:0}.plateau progress{width:100%}.plateau img{width:100%}
.plateau svg{width:100%;height:auto;font-size:18px}.plateau svg text{fill:currentColor}
.plateau svg .title{font-weight:600}.plateau .grid{stroke:currentColor;opacity:.2}
.plateau polyline{fill:none;stroke-width:2}.plateau .curve polyline{stroke:var(--curve)}
.plateau .curve circle{fill:var(--curve)}.plateau .estimate polyline{stroke:var(--estimate)}
.plateau .estimate circle{fill:var(--estimate)}.plateau .band{fill:var(--estimate);opacity:.2}
.plateau .target{stroke:var(--stop)}.plateau svg text.target{fill:var(--stop);stroke:none}
.plateau .stop{stroke:currentColor;stroke-dasharray:4 3}
"""


def card(job: JobView, points: list[CurvePoint], png: bytes | None, *notes: str) -> str:
    """A job as HTML: a line about it, the image that there is, the curve, its newest figures."""
    cap = job.spec.max_spp
    spp = job.spp if job.state.ended else max(job.spp, job.committed_spp)
    parts = [f"<p>{headline(job)}</p>"]
    if not job.state.ended:
        label = f"{spp:,} of at most {cap:,} spp"
        parts.append(
            f'<p><progress max="{cap}" value="{spp}" aria-label="{label}"></progress>{label}</p>'
        )
    if png is not None:
        source = base64.b64encode(_smaller(png)).decode()
        alt = f"The image at {job.image_spp or job.spp:,} spp"
        parts.append(f'<img alt="{alt}" src="data:image/png;base64,{source}">')
    if points:
        parts.append(job_svg(job, points))
        parts.append(f"<p>{escape(' · '.join(job_text.point_figures(job, points[-1])))}</p>")
    parts += [f"<p>{escape(note)}</p>" for note in notes]
    return f'<style>{_STYLE}</style><div class="plateau">{"".join(parts)}</div>'


def headline(job: JobView) -> str:
    """A job in one line of HTML: name, state, spp, time and reason."""
    about = [
        job.outcome if not job.spp else f"{job.outcome} at {job.spp:,} spp",
        *([] if job.width is None else [f"{job.width}×{job.height}", job.variant or ""]),
        figures.duration(job.duration_s(utc_now())),
        job.time_left,
    ]
    line = escape(" · ".join(filter(None, about)))
    return f"<b>{escape(job.name)}</b> {line}<br>{escape(job.reason)}"


def _smaller(png: bytes) -> bytes:
    """The picture with at most `_MOST_PIXELS` in a row or column, if Pillow is installed."""
    try:
        from PIL import Image
    except ModuleNotFoundError:
        return png
    with Image.open(io.BytesIO(png)) as picture:
        if max(picture.size) <= _MOST_PIXELS:
            return png
        picture.thumbnail((_MOST_PIXELS, _MOST_PIXELS))
        small = io.BytesIO()
        picture.save(small, "PNG")
    return small.getvalue()
