"""Whether the means of zones are biased: many renders of a scene against independent ones."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from statistics import NormalDist
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.support.recordings import HARD, HARD_SCENES, SCENES
from plateau import scenes
from plateau.client import Client
from plateau.farm.model.spec import JobSpec
from plateau.farm.wire.views import JobView
from plateau.metric.zone_noise import zone_sums

SIDE, ZONE = 64, 16
#: The target is looser than the default, since fewer samples bias more.
BY_ZONES = {
    "allocation": {"name": "zones", "size": ZONE},
    "rule": {"name": "visible", "target": 0.001},
    "max_spp": 1000,
}
WHOLE = {"rule": {"name": "fixed", "spp": 500}, "max_spp": 500}
#: How often a farm without bias would be found biased, over all zones of all scenes.
FALSE_ALARM = 1e-3


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
    def of(cls, some: NDArray[np.float64], others: NDArray[np.float64]) -> "Difference":
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
        return self.error * t

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


def compared(client: Client, subject: Subject, renders: int) -> tuple[float, float]:
    """Render a scene by zones and by frame, so many jobs each.

    Return the greatest deviation of a zone's mean, of what chance allows, and the mean of the most
    spp of a pixel over the least.
    """
    zoned = rendered(client, subject, BY_ZONES, range(renders))
    whole = rendered(client, subject, WHOLE, range(renders, 2 * renders))
    zones = Difference.of(
        *(np.stack([zone_means(client.array(job.id)) for job in jobs]) for jobs in (zoned, whole))
    )
    spread = np.mean([(job.spp_max or 1) / (job.spp_min or 1) for job in zoned])
    return zones.greatest(zones.mean.size * len(subjects())), float(spread)


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
