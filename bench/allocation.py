"""What samples by zones save: `make bench-allocation`.

Jobs of each scene, of whole frames and by zones, are replayed from recorded slices until `visible`
stops them. What they leave visible is counted by the noise of the whole recording.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from bench.support.film import JUDGING, OTHERS, Film, modelled, spread
from bench.support.recordings import PAPER, RECORDED, SCENES, parser_of, recorded, recordings_row
from bench.support.report import last_tables, write_report
from bench.support.truth import Truth
from plateau.metric import Evidence, Mask, Visible, VisibleDifferences
from plateau.metric.allocation import plan_round
from plateau.metric.compiled import CompiledVisibleDifferences

TARGET: Final = 0.0002
FRAMES: Final = "whole frames"
SPP, ESTIMATE, TRUTH, SAME = "spp", "estimate", "truth", "spp at the target's truth"
_NOTES = (
    "Jobs are replayed: a pixel's first samples are the same in every way to spread them.",
    "A round is always in flight: it was decided before the image that is judged.",
    "Truth is a mean over 12 samples of noise, scaled; a job has seen 10 % to 30 % of it.",
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


#: The ways to allocate.
WAYS: dict[str, Callable[[], Way]] = {
    FRAMES: Frames,
    "zones, 16 px": lambda: Zones(16),
    "zones, 32 px": lambda: Zones(32),
    "zones, 64 px": lambda: Zones(64),
    "zones, 16 px, by the judging halves": lambda: Zones(16, JUDGING),
}


def main() -> None:
    asked = parser_of(__doc__).parse_args()
    for name in asked.cases:
        truth = Truth(
            CompiledVisibleDifferences(PAPER), recorded(SCENES[name], asked), asked.slice_spp
        )
        column = {"way": f"{name}, {asked.pixels} px", **cells(measured(truth, asked.runs))}
        known = {row[0]: row for row in last_tables("allocation")["allocation"]}
        # Scenes are columns; what is not measured any more stays.
        head = known["way"]
        place = head.index(column["way"]) if column["way"] in head else len(head)
        for way, row in known.items():
            row[place : place + 1] = [column.get(way, row[place] if place < len(row) else "–")]
        recordings = [RECORDED, recordings_row(name, asked, asked.runs)]
        write_report(
            "allocation",
            {"allocation": list(known.values()), "allocation-recordings": recordings},
            settings={"target": TARGET},
            notes=_NOTES,
            document="allocation.md",
        )


def measured(truth: Truth, runs: int) -> dict[str, dict[str, float]]:
    """Return what each way spent and left, as means over the runs; nothing if one did not end."""
    metric, recording = truth.metric, truth.recording
    allowed = TARGET * recording.shape[1] * recording.shape[2]
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
    return {
        name: {what: float(np.mean([row[what] for row in some])) for what in some[0]}
        for name, some in rows.items()
        if len(some) == runs
    }


def cells(found: dict[str, dict[str, float]]) -> dict[str, str]:
    """Return the cell of each way: what it saves, at the same truth, and estimate over truth."""
    frames = found.get(FRAMES, {})

    def fewer(one: dict[str, float], what: str) -> str:
        return f"{frames[what] / one[what]:.2f}" if what in frames else "–"

    return {
        way: "not ended" if one is None
        else f"{fewer(one, SPP)}, {fewer(one, SAME)}, "
        + (f"{one[ESTIMATE] / one[TRUTH]:.2f}" if one[TRUTH] else "–")
        for way in WAYS
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
