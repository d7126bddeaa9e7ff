"""What the two eyes cost: the monitor's share of a job's CPU time: `make bench-eye_costs`.

`plateau render` makes an image up to its cap, judged by `visible` or by `jod` at every
step. Neither is ever content.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, Final

from bench.support import markdown
from bench.support.farms import plateau_render
from bench.support.report import Figure, write_report
from plateau.scenes import FOLDER

_SCENE: Final = "box"
_STEP: Final = 50
_WIDTH, _HEIGHT, _SPP = 1920, 1080, 200
#: Rules by the names of the two models of vision, with targets that are not reached.
_RULES: Final = {"Yee 2004": "visible:target=1e-9", "ColorVideoVDP": "jod:target=9.99"}
_EVERY_S: Final = 0.25


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.parse_args()
    figures = []
    for eye, rule in _RULES.items():
        share = _share(rule)
        print(f"{eye}: {share}", file=sys.stderr)
        figures.append(
            Figure(
                name=_name(eye),
                value=round(share, 4),
                unit="of the CPU time",
                goal="under 0.05",
            )
        )
    report = write_report(
        "eye_costs",
        figures,
        settings={"scene": _SCENE, "step": _STEP},
        notes=["From the command line to the results; one run each."],
    )
    markdown.fill(markdown.DOCS / "eyes.md", tables(report))


def _share(rule: str) -> float:
    """Return the monitor's share of the CPU time of a job that goes to its cap."""
    options = {"--rule": rule, "--max-spp": _SPP, "--step": _STEP, "--denoise": "none"}
    with tempfile.TemporaryDirectory() as folder:
        process = plateau_render.start(
            FOLDER / _SCENE,
            Path(folder),
            parameters={"width": _WIDTH, "height": _HEIGHT},
            options=options,
        )
        watch = plateau_render.Watch(process)
        while process.poll() is None:
            watch.look()
            time.sleep(_EVERY_S)
    last = watch.looks[-1]
    return last.monitor / last.all_


def _name(eye: str) -> str:
    return f"{_WIDTH}×{_HEIGHT}: {eye}"


def tables(report: dict[str, Any]) -> dict[str, str]:
    """Return the table by the name of its place in the document."""
    found = {one["name"]: one["value"] for one in report["figures"]}
    shares = [f"{found[_name(eye)]:.1%}" for eye in _RULES]
    row = [f"{_WIDTH}×{_HEIGHT}, {_SPP} spp", *shares]
    return {"eye-costs": markdown.table(["", *_RULES], [row])}


if __name__ == "__main__":
    main()
