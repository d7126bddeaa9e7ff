"""What samples by zones save: `make bench-allocation`.

Jobs of each scene are replayed from recorded slices until the rule `visible` stops them: whole
frames, the farm's zones, and other ways to spread samples. What they leave visible is then counted
by the noise of the whole recording, and so is how many samples each way needs for the same truth.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from bench.support.film import JUDGING, OTHERS, Film, modelled, spread
from bench.support.other_rules import CYCLES_FACTOR, cycles_error, with_neighbours
from bench.support.recordings import RECORDED, SCENES, parser_of, recorded, recordings_row
from bench.support.report import last_tables, renewed, turned, write_report
from bench.support.truth import Truth
from plateau.metric import Evidence, Mask, View, Visible, VisibleDifferences
from plateau.metric.allocation import plan_round
from plateau.metric.compiled import CompiledVisibleDifferences
from plateau.metric.estimate import allowed_pixels
from plateau.metric.zone_noise import zone_sums

TARGET: Final = 0.0002
FRAMES, ORACLE = "whole frames", "oracle, {} px"
SPP, ESTIMATE, TRUTH, SAME = "spp", "estimate", "truth", "spp at the target's truth"
_NOTES = (
    "Jobs are replayed: a pixel's first samples are the same in every way to spread them.",
    "A round is always in flight: it was decided before the image that is judged.",
    "Truth is a mean over 12 samples of noise, scaled; a job has seen 10 % to 30 % of it.",
    "The oracle knows the noise of each zone from half of these, and is judged by the others.",
)


#: Samples of a round of whole frames, and the least share that a round adds to a job.
STEP, LEAST = 100, 0.04


class Way(Protocol):
    """One way to allocate."""

    def plan(
        self, film: Film, seen: Evidence, flying: NDArray[np.int64], target: float
    ) -> tuple[Mask, int]:
        """Return the pixels of the next round, and their samples.

        `seen` is the film as it is judged, and `flying` the samples of the round that is rendered.
        """


class Frames:
    """Whole frames."""

    def plan(self, film: Film, *_: Any) -> tuple[Mask, int]:
        """Return the next round."""
        return np.ones(film.spp.shape, np.bool_), film.whole(max(STEP, LEAST * film.mean_spp))


@dataclass
class Zones:
    """The farm's allocator."""

    size: int
    split: Any = OTHERS  #: of the slices: the noise by which it decides

    def plan(
        self, film: Film, seen: Evidence, flying: NDArray[np.int64], target: float
    ) -> tuple[Mask, int]:
        """Return the next round."""
        judged = seen if self.split is JUDGING else film.evidence(seen.metric, self.split)
        each = np.s_[:: self.size, :: self.size]
        plan = plan_round(
            seen.metric,
            *modelled(judged),
            target,
            spp=film.spp[each],
            planned=(film.spp + flying)[each],
            size=self.size,
        )
        return spread(plan.zones, self.size, film.spp), film.whole(plan.spp)


@dataclass
class Naive:
    """Zones that have too much to see get a quarter more, or a half if it is far too much."""

    size: int

    def plan(
        self, film: Film, seen: Evidence, flying: NDArray[np.int64], target: float
    ) -> tuple[Mask, int]:
        """Return the next round."""
        estimate = modelled(seen)[2]
        share = zone_sums(estimate.visible, self.size) / self.size**2
        around = np.pad(share, 1, mode="edge")
        rows, columns = share.shape
        near = np.mean([around[y : y + rows, x : x + columns] for y, x in np.ndindex(3, 3)], axis=0)
        excess = np.maximum(share, near / 2) / target
        wanted = excess > (8 if (excess > 8).mean() > LEAST else 1)
        if not wanted.any():
            wanted = excess >= excess.max()
        pixels: Mask = spread(wanted, self.size, film.spp)
        growth = 0.5 if (excess[wanted] > 8).all() else 0.25
        return pixels, film.whole(growth * (film.spp + flying)[pixels].mean())


@dataclass
class Neyman:
    """Samples in proportion to the standard deviation of a zone's displayed noise."""

    size: int

    def plan(
        self, film: Film, seen: Evidence, flying: NDArray[np.int64], *_: Any
    ) -> tuple[Mask, int]:
        """Return the next round."""
        model = modelled(seen)[0]
        energy = zone_sums(np.square(model.noise).sum(axis=-1) * film.spp, self.size)
        planned = film.spp + flying
        lack = np.sqrt(energy) / planned[:: self.size, :: self.size]
        pixels: Mask = spread(lack >= np.quantile(lack, 0.75), self.size, film.spp)
        return pixels, film.whole(0.25 * planned[pixels].mean())


@dataclass
class Cycles:
    """Pixels whose error is above Cycles' threshold, with their neighbours.

    The threshold is halved as often as the whole image still has more to see than the target.
    """

    threshold: float = 0.01

    def plan(
        self, film: Film, seen: Evidence, flying: NDArray[np.int64], *_: Any
    ) -> tuple[Mask, int]:
        """Return the next round."""
        assert seen.halves is not None
        error = cycles_error(seen.image, seen.halves[0].mean)
        while True:
            pixels = with_neighbours(error > CYCLES_FACTOR * self.threshold)
            if pixels.mean() > LEAST:
                return pixels, film.whole(0.25 * (film.spp + flying)[pixels].mean())
            self.threshold /= 2


#: The ways to allocate.
WAYS: dict[str, Callable[[], Way]] = {
    FRAMES: Frames,
    "zones, 16 px": lambda: Zones(16),
    "zones, 32 px": lambda: Zones(32),
    "zones, 64 px": lambda: Zones(64),
    "zones, 16 px, by the judging halves": lambda: Zones(16, JUDGING),
    "naive, 16 px": lambda: Naive(16),
    "Neyman, 16 px": lambda: Neyman(16),
    "Cycles, by pixels": Cycles,
}


def main() -> None:
    asked = parser_of(__doc__).parse_args()
    for name in asked.cases:
        truth = Truth(
            CompiledVisibleDifferences(View()), recorded(SCENES[name], asked), asked.slice_spp
        )
        column = cells(measured(truth, asked.runs))
        table = [["way", f"{name}, {asked.pixels} px"], *map(list, column.items())]
        known = last_tables("allocation").get("allocation")
        # Scenes are columns.
        whole = turned(renewed(known and turned(known), turned(table)))
        recordings = [RECORDED, recordings_row(name, asked, asked.runs)]
        write_report(
            "allocation",
            {"allocation": whole, "allocation-recordings": recordings},
            settings={"target": TARGET},
            notes=_NOTES,
            document="allocation.md",
        )


def measured(truth: Truth, runs: int) -> dict[str, dict[str, float]]:
    """Return what each way spent and left, as means over the runs; nothing if one did not end."""
    metric, recording = truth.metric, truth.recording
    allowed = allowed_pixels(TARGET, recording.shape[1] * recording.shape[2])
    rows: dict[str, list[dict[str, float]]] = {}
    for run in range(runs):
        order = np.random.default_rng(run).permutation(len(recording))
        film = Film(recording, truth.slice_spp, order)
        for name, way in WAYS.items():
            film.clear()
            estimate = ended(film, way(), metric)
            if estimate is not None:
                left = float(truth.visible(film.spp).sum())
                same = truth.spp_at(allowed, film.spp)
                row = {SPP: film.mean_spp, ESTIMATE: estimate, TRUTH: left, SAME: same}
                rows.setdefault(name, []).append(row)
    found = {
        name: {what: float(np.mean([row[what] for row in some])) for what in some[0]}
        for name, some in rows.items()
        if len(some) == runs
    }
    return found | {ORACLE.format(size): {SAME: truth.oracle(allowed, size)} for size in (16, 32)}


def cells(found: dict[str, dict[str, float]]) -> dict[str, str]:
    """Return the cell of each way: what it saves, at the same truth, and estimate over truth."""
    frames = found.get(FRAMES, {})

    def fewer(one: dict[str, float], what: str) -> str:
        return f"{frames[what] / one[what]:.2f}" if what in frames else "–"

    return {
        way: "not ended" if one is None
        else f"same truth {fewer(one, SAME)}" if SPP not in one
        else f"{fewer(one, SPP)}, {fewer(one, SAME)}, "
        + (f"{one[ESTIMATE] / one[TRUTH]:.2f}" if one[TRUTH] else "–")
        for way in (*WAYS, *(ORACLE.format(size) for size in (16, 32)))
        for one in [found.get(way)]
    }  # fmt: skip


def ended(film: Film, way: Way, metric: VisibleDifferences) -> float | None:
    """Render a job to its end; return its estimate, None if the recording was too short."""
    rule = Visible(target=TARGET)
    everywhere = np.ones(film.spp.shape, np.bool_)
    film.add(everywhere, film.whole(100))
    flying = everywhere, film.whole(100)
    while True:
        seen = film.evidence(metric)
        if rule.judge(seen).stop:
            assert seen.estimate is not None
            return seen.estimate.pixels
        following = way.plan(film, seen, np.where(flying[0], flying[1], 0), TARGET)
        film.add(*flying)
        flying = following
        if film.exhausted:
            return None


if __name__ == "__main__":
    main()
