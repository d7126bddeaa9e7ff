"""Whether jobs by zones are biased: many real renders of each scene, against independent ones.

`make bench-bias` has a farm render each scene many times by zones, each time with another seed,
until its rule ends the job. The mean of every zone is compared with that of renders of whole
frames, which have other seeds and end at a cap. All films are small, so that jobs are short.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from statistics import NormalDist
from typing import TYPE_CHECKING, Any

import numpy as np

from bench.allocating.recordings import HARD, HARD_SCENES, SCENES
from bench.support import markdown
from bench.support.farms.service_farm import ServiceFarm
from bench.support.report import Figure, last_figures, last_report, write_report
from plateau import scenes
from plateau.client import Client
from plateau.farm.model.spec import JobSpec
from plateau.metric.zone_noise import zone_sums

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from plateau.farm.wire.views import JobView

SIDE, ZONE = 64, 16
#: The target is looser than the default, since fewer samples bias more.
BY_ZONES = {
    "allocation": {"name": "zones", "size": ZONE},
    "rule": {"name": "visible", "target": 0.001},
    "max_spp": 1000,
}
#: Jobs of whole frames, and the samples of each.
REFERENCES, REFERENCE_SPP = 64, 500
WHOLE = {"rule": {"name": "fixed", "spp": REFERENCE_SPP}, "max_spp": REFERENCE_SPP}
#: How often a farm without bias would be found biased, over all zones of all scenes.
FALSE_ALARM = 1e-3
_WHAT = {
    "zones outside their 95 % interval": "zones",
    "zones": "zones",
    "greatest deviation": "of what chance allows",
    "mean": "fraction of the mean",
    "doubt": "fraction of the mean",
    "spp": "spp",
    "most spp over least": "ratio",
}


@dataclass(frozen=True)
class Subject:
    """A scene to be rendered."""

    path: Path
    parameters: dict[str, Any]


@dataclass(frozen=True)
class Difference:
    """How the mean of many renders differs from that of others, each (renders, ...)."""

    mean: NDArray[np.float64]
    #: Its standard error.
    error: NDArray[np.float64]
    #: Its degrees of freedom.
    freedom: NDArray[np.float64]

    @classmethod
    def of(cls, some: NDArray[np.float64], others: NDArray[np.float64]) -> Difference:
        """Return it by Welch (doi 10.1093/biomet/34.1-2.28)."""
        parts = [one.var(axis=0, ddof=1) / len(one) for one in (some, others)]
        variance = parts[0] + parts[1]
        squares = sum(
            np.square(part) / (len(one) - 1)
            for part, one in zip(parts, (some, others), strict=True)
        )
        freedom = np.ones_like(variance)  # of a zone that is black, as it always was
        np.divide(np.square(variance), squares, out=freedom, where=variance > 0)
        return cls(some.mean(axis=0) - others.mean(axis=0), np.sqrt(variance), freedom)

    def interval(self, share: float) -> NDArray[np.float64]:
        """Return half the width of the interval that has this share of all differences by chance.

        Student's quantile is expanded around the normal one (Fisher and Cornish, 1960).
        """
        z = NormalDist().inv_cdf((1 + share) / 2)
        n = self.freedom
        t = z + (z**3 + z) / (4 * n) + (5 * z**5 + 16 * z**3 + 3 * z) / (96 * n**2)
        width: NDArray[np.float64] = self.error * t
        return width

    def outside(self, share: float) -> int:
        """Return how many differ by more than the interval of this share."""
        return int((np.abs(self.mean) > self.interval(share)).sum())

    def greatest(self, tests: int) -> float:
        """Return the greatest difference over what chance allows among so many (Sidak)."""
        allowed = self.interval((1 - FALSE_ALARM) ** (1 / tests))
        return float(
            np.divide(
                np.abs(self.mean), allowed, out=np.zeros_like(allowed), where=allowed > 0
            ).max()
        )


def subjects() -> dict[str, Subject]:
    """Return the scenes: those of the paper, and two whose light is found by luck."""
    film = {"width": SIDE, "height": SIDE}
    found = {
        name: Subject(scenes.FOLDER / case.family, {**film, "intensity": case.intensity})
        for name, case in SCENES.items()
    }
    return found | {
        name: Subject(HARD_SCENES / f"{case.family}.xml", dict(film)) for name, case in HARD.items()
    }


def main() -> None:
    every = subjects()
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", nargs="+", choices=every, default=list(every))
    parser.add_argument("--renders", type=int, default=64, help="of each scene by zones (64)")
    asked = parser.parse_args()
    kept = last_figures("bias")
    names = list(last_report("bias")["settings"].get("scenes", []))
    with tempfile.TemporaryDirectory() as folder:
        cores = len(os.sched_getaffinity(0))
        farm = ServiceFarm(Path(folder), jobs=0, threads=1, workers=cores)
        with farm, Client(farm.url) as client:
            for name in asked.cases:
                found = compared(client, every[name], asked.renders)
                kept = [one for one in kept if not one.name.startswith(f"{name}: ")]
                kept += [
                    Figure(name=f"{name}: {what}", value=value, unit=_WHAT[what])
                    for what, value in found.items()
                ]
                names += [name] if name not in names else []
                print(f"{name}: {found}", file=sys.stderr)
    about = {
        "scenes": names,
        "size": f"{SIDE}×{SIDE}",
        "renders": asked.renders,
        "by zones": BY_ZONES,
        "whole frames": f"{REFERENCES} of {REFERENCE_SPP} spp",
        "false alarm": FALSE_ALARM,
    }
    report = write_report("bias", kept, settings=about, notes=["Means are of R, G and B."])
    markdown.fill(markdown.DOCS / "allocation.md", tables(report))


def compared(
    client: Client, subject: Subject, renders: int, references: int = REFERENCES
) -> dict[str, float]:
    """Render a scene by zones and by frame, and compare the means of its zones."""
    zoned = rendered(client, subject, BY_ZONES, range(renders))
    whole = rendered(client, subject, WHOLE, range(renders, renders + references))
    some, others = (
        np.stack([zone_means(client.array(job.id)) for job in jobs]) for jobs in (zoned, whole)
    )
    zones = Difference.of(some, others)
    image = Difference.of(*(one.mean(axis=(1, 2)) for one in (some, others)))
    truth = others.mean()
    values = (
        zones.outside(0.95),
        zones.mean.size,
        zones.greatest(zones.mean.size * len(subjects())),
        float(image.mean) / truth,
        float(image.interval(0.95)) / truth,
        np.mean([job.spp for job in zoned]),
        np.mean([(job.spp_max or 1) / (job.spp_min or 1) for job in zoned]),
    )
    return dict(zip(_WHAT, map(float, values), strict=True))


def rendered(
    client: Client, subject: Subject, spec: dict[str, Any], seeds: Iterable[int]
) -> list[JobView]:
    """Return finished jobs of a scene, one for each seed."""
    asked = {**spec, "parameters": subject.parameters}
    jobs = [client.submit(subject.path, JobSpec(**asked, seed=seed)) for seed in seeds]
    return [client.wait(job.id) for job in jobs]


def zone_means(image: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return the mean of each zone, all channels together, (rows, columns)."""
    return zone_sums(image.mean(axis=-1, dtype=np.float64), ZONE) / ZONE**2


def tables(report: dict[str, Any]) -> dict[str, str]:
    """Return the table by the name of its place in the document."""
    values = {one["name"]: one["value"] for one in report["figures"]}

    def row(scene: str) -> list[str]:
        outside, zones, greatest, mean, doubt, spp, spread = (
            values[f"{scene}: {what}"] for what in _WHAT
        )
        return [
            scene,
            f"{spp:,.0f}",
            f"{spread:.1f}",
            f"{outside:.0f} of {zones:.0f}",
            f"{greatest:.2f}",
            f"{mean:+.3%} ± {doubt:.3%}",
        ]

    head = [
        "scene",
        "mean spp",
        "most over least",
        "zones outside their 95 % interval",
        "greatest deviation, of what chance allows",
        "error of the whole image's mean",
    ]
    return {
        "allocation-renders": markdown.table(head, list(map(row, report["settings"]["scenes"]))),
    }


if __name__ == "__main__":
    main()
