"""The results of a study: the answers at each level, the fit, and CSV files."""

from collections import Counter
from collections.abc import Iterator
from typing import TYPE_CHECKING, Final

from plateau.farm.wire.csv_text import csv_text
from plateau.study.ledger import Studies
from plateau.study.model import MOST_STUDIES, PROBABILITIES, Answer, Observer, Study
from plateau.study.views import LevelResult, StudyResult, Threshold

if TYPE_CHECKING:
    from plateau.study.answers import AnswersFit

TRIALS_HEADER: Final = (
    "scene",
    "observer",
    "trial",
    "spp",
    "reference",
    "seen",
    "seconds",
    "at",
    "pixels_per_degree",
    "viewing_distance_cm",
    "gamma_matches",
)


class StudyResults:
    """The results of studies so far, computed again only after new answers."""

    def __init__(self, studies: Studies) -> None:
        self._studies = studies
        self._known: dict[str, tuple[tuple[int, int], StudyResult]] = {}

    def of(self, study: Study) -> StudyResult:
        """The study's results so far."""
        # Counted before the answers are read: the next call sees any that come in between.
        counts = self._studies.counts(study)
        known = self._known.get(study.id)
        if known is not None and known[0] == counts:
            return known[1]
        observers, answers = self._studies.observers(study), self._studies.answers(study)
        found = study_result(study, observers, answers)
        if len(self._known) >= 2 * MOST_STUDIES:  # at least half of these studies are deleted
            self._known.clear()
        self._known[study.id] = (counts, found)
        return found


def study_result(study: Study, observers: list[Observer], answers: list[Answer]) -> StudyResult:
    """The study's results by these observers and answers."""
    levels = _levels(study, answers)
    fit = _fit(answers)
    pairs = len(study.pairs(0))
    given = Counter(one.observer for one in answers)
    return StudyResult(
        observers=len(observers),
        finished=list(given.values()).count(pairs),
        answers=len(answers),
        levels=levels,
        a=None if fit is None else fit.a,
        b=None if fit is None else fit.b,
        thresholds=[] if fit is None else list(_thresholds(fit)),
        suggested_levels=_suggested(levels, study.slice_spp),
    )


def trials_csv(study: Study, observers: list[Observer], answers: list[Answer]) -> str:
    """All answers, a line each."""
    screens = {observer.name: observer.screen for observer in observers}
    rows: list[list[object]] = [list(TRIALS_HEADER)]
    for one in answers:
        screen = screens[one.observer]
        gamma = "" if screen.gamma_matches is None else str(screen.gamma_matches).lower()
        rows.append(
            [
                study.name,
                one.observer,
                one.trial,
                one.spp,
                one.reference,
                str(one.seen).lower(),
                f"{one.seconds:.3f}",
                one.at.isoformat(),
                f"{screen.pixels_per_degree:.2f}",
                f"{screen.viewing_distance_cm:g}",
                gamma,
            ]
        )
    return csv_text(rows)


def _levels(study: Study, answers: list[Answer]) -> list[LevelResult]:
    found = {spp: LevelResult(spp=spp, shown=0, seen=0) for spp in study.levels}
    for one in answers:
        found[one.spp].shown += 1
        found[one.spp].seen += one.seen
    return [found[spp] for spp in study.levels]


def _fit(answers: list[Answer]) -> "AnswersFit | None":
    if len({one.spp for one in answers}) < 2:
        return None
    from plateau.study.answers import fit_answers  # imports numpy, so only once answers exist

    fit = fit_answers(
        [one.spp for one in answers],
        [one.seen for one in answers],
        [one.observer for one in answers],
    )
    return None if fit.refusal else fit


def _thresholds(fit: "AnswersFit") -> Iterator[Threshold]:
    """Yield the thresholds that the answers bound."""
    for probability in PROBABILITIES:
        interval = fit.interval(probability)
        if interval is not None:
            low, high = interval
            spp = fit.threshold(probability)
            yield Threshold(probability=probability, spp=spp, low_spp=low, high_spp=high)


def _suggested(levels: list[LevelResult], slice_spp: int) -> list[int]:
    """Seven levels from the last that nearly all see to the first that hardly anybody sees."""
    shares = [(one.spp, one.seen / one.shown) for one in levels if one.shown]
    if not shares:
        return []
    low = max((spp for spp, share in shares if share >= 0.95), default=shares[0][0])
    high = min((spp for spp, share in shares if share <= 0.05 and spp > low), default=shares[-1][0])
    steps = ((low + (high - low) * place / 6) / slice_spp for place in range(7))
    return sorted({slice_spp * max(1, round(one)) for one in steps})
