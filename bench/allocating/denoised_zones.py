"""A job whose samples go by zones to where its denoised image is wrong: a recording replayed."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bench.allocating.film import OTHERS, Film, spread
from bench.allocating.truth import wrong_share
from plateau.metric import Evidence, Visible, blend_error, blended

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from plateau.metric import Denoise, VisibleDifferences

#: Side of a zone in pixels, and samples of each of the first two rounds.
SIZE, STEP = 16, 100


class Look(NamedTuple):
    """A look at the image: at the end of a round."""

    spp: float  #: the mean over the film
    seen: Evidence
    wrong: float  #: the share of the pixels that are visibly wrong


def looks(
    recording: NDArray[np.float32],
    slice_spp: int,
    order: NDArray[np.intp],
    denoise: Denoise,
    metric: VisibleDifferences,
) -> Iterator[Look]:
    """Yield the looks of a job until the rule `visible` ends it, or the recording does."""
    film, rule = Film(recording, slice_spp, order), Visible()
    everywhere = np.ones(film.spp.shape, np.bool_)
    each = np.s_[::SIZE, ::SIZE]
    film.add(everywhere, film.whole(STEP))
    flying = everywhere, film.whole(STEP)
    while True:
        raw = film.evidence(metric)
        assert raw.halves is not None
        blend, error = blended(raw.image, raw.halves, denoise, metric.view)
        seen = Evidence(raw.spp, blend.image, None, metric, error)
        reference, noise = film.reference()
        wrong = wrong_share(metric, reference, noise, blend.image, error.likely.noise)
        yield Look(film.mean_spp, seen, wrong)
        if rule.judge(seen).stop:
            return
        others = film.evidence(metric, OTHERS)
        assert others.halves is not None
        chosen_by = blend_error(blend, others.image, others.halves, denoise, metric.view)
        plan = Evidence(raw.spp, blend.image, None, metric, chosen_by).allocation(
            rule.target,
            spp=film.spp[each],
            planned=(film.spp + np.where(*flying, 0))[each],
            size=SIZE,
        )
        assert plan is not None
        film.add(*flying)
        flying = spread(plan.zones, SIZE, film.spp), film.whole(plan.spp)
        if film.exhausted:
            return
