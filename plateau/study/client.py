"""The client's calls for observer studies."""

from collections.abc import Sequence
from typing import Any, Final

from plateau.client import Client
from plateau.client.transport import Calls
from plateau.study.model import Screen
from plateau.study.order import Method
from plateau.study.views import AnswerView, ObserverView, StudyList, StudyView

#: The service merges hundreds of slices before it answers.
_MAKING_S: Final = 600.0


class StudyCalls(Calls):
    """Observer studies: making, taking part, export; over the connections of a client."""

    def __init__(self, client: Client) -> None:
        self._transport = client._transport

    def create(
        self,
        job_id: str,
        *,
        reference_job_id: str | None = None,
        method: Method = "constant",
        levels: Sequence[int] | None = None,
        name: str | None = None,
    ) -> StudyView:
        """Make a study of an ended job that kept its slices; a repeated request makes only one.

        Parameters
        ----------
        job_id
            The job whose first slices make the test images.
        reference_job_id
            Another such job, best of the same scene with another seed; None for the job itself.
        method
            ``constant`` for the thresholds, ``limits`` to find where they lie.
        levels
            Spp of the test images, in whole slices; None for the paper's 1 % to 25 %.
        name
            The study's name in tables; None for the job's name.

        Raises
        ------
        ApiError
            ``unknown-job``; ``cannot-study`` if the slices do not allow the study.
        """
        asked: dict[str, Any] = {
            "job_id": job_id,
            "reference_job_id": reference_job_id,
            "method": method,
            "levels": None if levels is None else list(levels),
            "name": name,
        }
        return self._transport.ask(StudyView, "POST", "/v1/studies", json=asked, timeout=_MAKING_S)

    def all(self) -> list[StudyView]:
        """All studies, newest first."""
        return self._transport.read(StudyList, "/v1/studies").studies

    def get(self, study_id: str) -> StudyView:
        """A study, with its results so far; ``unknown-study`` if it does not exist."""
        return self._transport.read(StudyView, f"/v1/studies/{study_id}")

    def delete(self, study_id: str) -> None:
        """Remove a study with all its answers and pictures.

        Raises `ApiError`: ``unknown-study``, ``not-your-study``.
        """
        self._transport.send("DELETE", f"/v1/studies/{study_id}")

    def take_part(self, study_id: str, observer: str, screen: Screen) -> ObserverView:
        """Take part under a pseudonym, or continue; returns the pairs in the observer's order.

        Raises `ApiError`: ``unknown-study``; ``cannot-study`` if it has the most observers already.
        """
        path = f"/v1/studies/{study_id}/observers/{observer}"
        asked = {"screen": screen.model_dump(mode="json")}
        return self._transport.ask(ObserverView, "PUT", path, json=asked)

    def answer(
        self, study_id: str, observer: str, trial: int, *, seen: bool, seconds: float
    ) -> AnswerView:
        """Answer a pair; returns the answer that counts, which is the first.

        Raises `ApiError`: ``unknown-study``, ``unknown-observer``, ``unknown-trial``.
        """
        path = f"/v1/studies/{study_id}/observers/{observer}/answers/{trial}"
        asked = {"seen": seen, "seconds": seconds}
        return self._transport.ask(AnswerView, "PUT", path, json=asked)

    def trials_csv(self, study_id: str) -> str:
        """The answers as CSV, one line for each."""
        return self._transport.send("GET", f"/v1/studies/{study_id}/trials.csv").text
