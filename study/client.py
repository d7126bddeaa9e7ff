"""Calls about observer studies."""

from collections.abc import Sequence
from typing import Any, Final, Literal

from plateau.client.transport import Calls, Transport
from plateau.study.model import Screen
from plateau.study.order import Method
from plateau.study.views import AnswerView, ObserverView, StudyList, StudyView

#: Hundreds of slices are merged before the answer comes.
_MAKING_S: Final = 600.0


class StudyCalls(Calls):
    """Observer studies: made from kept slices, taken part in, exported.

    `plateau.Client.studies` is one over the client's connections.
    """

    def __init__(self, transport: Transport) -> None:
        self._transport = transport

    def create(
        self,
        job_id: str,
        *,
        reference_job_id: str | None = None,
        method: Method = "constant",
        levels: Sequence[int] | None = None,
        name: str | None = None,
    ) -> StudyView:
        """Make a study of an ended job that kept its slices; the same request makes one only.

        Parameters
        ----------
        job_id
            Whose first slices the test images are.
        reference_job_id
            Another such job, best of the same scene with another seed; None for the job itself.
        method
            ``constant`` for the thresholds, ``limits`` to find where they lie.
        levels
            Spp of the test images, whole slices; None for the paper's 1 % to 25 %.
        name
            What tables call it; None for the job's name.

        Raises
        ------
        ApiError
            ``unknown-job``; ``cannot-study`` where the slices do not suit what is asked.
        """
        asked: dict[str, Any] = {
            "job_id": job_id,
            "reference_job_id": reference_job_id,
            "method": method,
            "levels": None if levels is None else list(levels),
            "name": name,
        }
        answer = self._transport.send("POST", "/v1/studies", json=asked, timeout=_MAKING_S)
        return self._transport.understood(StudyView, answer)

    def all(self) -> list[StudyView]:
        """All studies, newest first."""
        return self._transport.read(StudyList, "/v1/studies").studies

    def get(self, study_id: str) -> StudyView:
        """A study, with what it has found so far; ``unknown-study`` where there is none."""
        return self._transport.read(StudyView, f"/v1/studies/{study_id}")

    def delete(self, study_id: str) -> None:
        """Remove a study with all its answers and pictures.

        Raises
        ------
        ApiError
            ``unknown-study``, ``not-your-study``.
        """
        self._transport.send("DELETE", f"/v1/studies/{study_id}")

    def take_part(self, study_id: str, observer: str, screen: Screen) -> ObserverView:
        """Take part under a pseudonym, or go on; returns the pairs in the observer's order.

        Raises
        ------
        ApiError
            ``unknown-study``; ``cannot-study`` where it has as many observers as it may.
        """
        path = f"/v1/studies/{study_id}/observers/{observer}"
        asked = {"screen": screen.model_dump(mode="json")}
        return self._transport.understood(
            ObserverView, self._transport.send("PUT", path, json=asked)
        )

    def answer(
        self, study_id: str, observer: str, trial: int, *, seen: bool, seconds: float
    ) -> AnswerView:
        """Answer to a pair; returns the answer that counts, which is the first.

        Raises
        ------
        ApiError
            ``unknown-study``, ``unknown-observer``, ``unknown-trial``.
        """
        path = f"/v1/studies/{study_id}/observers/{observer}/answers/{trial}"
        asked = {"seen": seen, "seconds": seconds}
        return self._transport.understood(AnswerView, self._transport.send("PUT", path, json=asked))

    def csv(self, study_id: str, what: Literal["answers", "trials"]) -> str:
        """The answers in the form of the paper's table 1, or every answer a line each."""
        return self._transport.send("GET", f"/v1/studies/{study_id}/{what}.csv").text
