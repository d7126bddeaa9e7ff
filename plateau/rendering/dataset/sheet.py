"""One HTML page of a data set: a thumbnail of each image, the worst first."""

import base64
from collections.abc import Iterable, Mapping
from html import escape
from pathlib import Path
from typing import Any, Final

from plateau.errors import needs
from plateau.files.job_folder import whole

NAME: Final = "sheet.html"
_STYLE: Final = """
body{font:14px/1.4 system-ui,sans-serif;margin:1rem}
main{display:grid;grid-template-columns:repeat(auto-fill,minmax(192px,1fr));gap:1rem}
figure{margin:0}img{max-width:100%}figcaption{overflow-wrap:anywhere}
"""


def write_sheet(folder: Path, lines: Iterable[Mapping[str, Any]], layout: str) -> None:
    """Write the page into the folder of a data set.

    Parameters
    ----------
    folder
        The folder.
    lines
        Those of its manifest, in the order of the page.
    layout
        How its images are stored.
    """
    figures = [_figure(folder, line, layout) for line in lines]
    text = (
        f'<!doctype html><meta charset="utf-8"><title>{escape(folder.name)}</title>'
        f"<style>{_STYLE}</style><h1>{escape(folder.name)}</h1><main>{''.join(figures)}</main>\n"
    )
    with whole(folder / NAME) as unfinished:
        unfinished.write_text(text, encoding="utf-8")


def _figure(folder: Path, line: Mapping[str, Any], layout: str) -> str:
    with needs("images"):
        from plateau.farm.images.exr import decode_image
        from plateau.farm.images.png import encode_png
        from plateau.picture.result_files import thumbnail

    picture = ""
    colours = [name for name in line["files"] if layout != "oidn" or name.endswith(".hdr.exr")]
    if colours:
        image = decode_image((folder / max(colours)).read_bytes())
        source = base64.b64encode(encode_png(thumbnail(image, 0.0))).decode()
        picture = f'<img alt="" src="data:image/png;base64,{source}">'
    words = f"<b>{escape(line['name'])}</b> {escape(line['reason'])}"
    return f"<figure>{picture}<figcaption>{words}</figcaption></figure>"
