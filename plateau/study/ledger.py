"""Observer studies in Redis.

A study has its own pictures, so it stays whole when its job is forgotten. They are put while
``…:making`` marks the study as being made, and the study appears once all are stored. A sweep
removes pictures without a study or a mark. An id is never used twice.

Every answer is in Redis, and so on disk, before it is acknowledged; the first one to a pair counts.
"""

import hashlib
import json
import secrets
from typing import Any, Final

from plateau.farm.blobs.store import Blobs, StoredBlob
from plateau.farm.model.job import moment
from plateau.farm.redis.client import RedisClient
from plateau.farm.redis.scripts import Scripts
from plateau.study import keys
from plateau.study.model import (
    MOST_OBSERVERS,
    MOST_STUDIES,
    Answer,
    CannotStudy,
    Observer,
    ObserverNotFound,
    Screen,
    Study,
    StudyNotFound,
    TrialNotFound,
)
from plateau.study.order import Pair
from plateau.study.redis_commands import (
    AnswerStudy,
    BeginStudy,
    CreateStudy,
    ForgetStudy,
    JoinStudy,
)

#: The longest time that making a study may take, in seconds.
_MAKING_S: Final = 1800.0
#: The folder of all studies' pictures; each study has a folder in it.
_STUDIES: Final = "studies/"


class Studies:
    """All studies. Every method raises `StoreUnavailable` when Redis is away."""

    def __init__(self, client: RedisClient) -> None:
        self._redis = client
        self._scripts = Scripts(client, keys.script())

    def begin(self) -> str:
        """Start making a study; returns its id, under which its pictures may now be put."""
        study_id = secrets.token_hex(6)
        self._scripts.run(BeginStudy(study=study_id, making_ms=round(_MAKING_S * 1000)))
        return study_id

    def made(self, request: dict[str, Any], owner: str) -> Study | None:
        """The study that an equal request of the owner has made, or None."""
        study_id = self._redis.hget(keys.STUDIES_ASKED, _digest(request, owner))
        return None if study_id is None else self.get(study_id)

    def create(self, study_id: str, request: dict[str, Any], owner: str, about: Any) -> Study:
        """Add a study whose pictures are stored, or return that of an equal request.

        Raises `CannotStudy` if the farm has too many studies, or this one took too long to make.
        """
        digest = _digest(request, owner)
        made = self._scripts.run(
            CreateStudy(
                study=study_id,
                digest=digest,
                owner=owner,
                about=json.dumps(about),
                most=MOST_STUDIES,
            )
        )
        if made.outcome == "late":
            raise CannotStudy(
                f"the study was not made: its pictures took more than {_MAKING_S / 60:g} min; ask "
                "for fewer levels"
            )
        if made.outcome == "too many":
            raise CannotStudy(
                f"the farm has {MOST_STUDIES} studies, as many as it may have; delete one that is "
                "done"
            )
        return self.get(made.study)

    def get(self, study_id: str) -> Study:
        """The study, or `StudyNotFound`."""
        fields = self._redis.hgetall(keys.study(study_id))
        if not fields:
            raise StudyNotFound(study_id)
        return _study(fields)

    def sha256(self, study_id: str, blob: str) -> str | None:
        """The digest of a picture of the study; None if it was not noted."""
        about = self._redis.hget(keys.study(study_id), "about")
        noted: dict[str, str] = json.loads(about or "{}").get("sha256", {})
        return noted.get(blob)

    def all(self) -> list[Study]:
        """All studies, newest first."""
        pipe = self._redis.pipeline(transaction=False)
        for study_id in self._redis.zrevrange(keys.STUDIES, 0, -1):
            pipe.hgetall(keys.study(study_id))
        return [_study(fields) for fields in pipe.execute() if fields]

    def join(self, study: Study, name: str, screen: Screen) -> Observer:
        """Add an observer; one who has joined before keeps the screen of the first time.

        Raises `StudyNotFound`, or `CannotStudy` if the study has the most observers already.
        """
        shown = screen.model_dump_json()
        outcome = self._scripts.run(
            JoinStudy(study=study.id, name=name, screen=shown, most=MOST_OBSERVERS)
        )
        if outcome == "missing":
            raise StudyNotFound(study.id)
        if outcome == "full":
            raise CannotStudy(
                f"study {study.id} has {MOST_OBSERVERS} observers, as many as it may have; make "
                "another study of the same job"
            )
        return self.observer(study, name)

    def observer(self, study: Study, name: str) -> Observer:
        """The observer of this name, or `ObserverNotFound`."""
        record = self._redis.hget(keys.study(study.id, "observers"), name)
        if record is None:
            raise ObserverNotFound(study.id, name)
        return _observer(name, record)

    def observers(self, study: Study) -> list[Observer]:
        """All observers, in the order in which they joined."""
        records = self._redis.hgetall(keys.study(study.id, "observers"))
        found = [_observer(name, record) for name, record in records.items()]
        return sorted(found, key=lambda observer: observer.number)

    def counts(self, study: Study) -> tuple[int, int]:
        """The numbers of observers and of answers; both only grow."""
        pipe = self._redis.pipeline(transaction=False)
        pipe.hlen(keys.study(study.id, "observers"))
        pipe.hlen(keys.study(study.id, "answers"))
        observers, answers = pipe.execute()
        return observers, answers

    def answer(
        self, study: Study, observer: Observer, trial: int, *, seen: bool, seconds: float
    ) -> Answer:
        """Record an answer durably, unless the pair has one; returns the answer that counts.

        Raises `TrialNotFound` or `StudyNotFound`.
        """
        shown = study.pairs(observer.number)
        if trial >= len(shown):
            raise TrialNotFound(study.id, trial, len(shown))
        given = json.dumps({"seen": seen, "seconds": seconds})
        stored = self._scripts.run(
            AnswerStudy(study=study.id, name=observer.name, trial=trial, given=given)
        )
        if stored is None:
            raise StudyNotFound(study.id)
        return _answer(observer, trial, shown[trial], stored)

    def answers(self, study: Study) -> list[Answer]:
        """All answers, by the order of observers, then by that of their pairs."""
        observers = {observer.name: observer for observer in self.observers(study)}
        records = self._redis.hgetall(keys.study(study.id, "answers"))
        shown = {name: study.pairs(observer.number) for name, observer in observers.items()}
        found = []
        for place, record in records.items():
            name, number = place.split(":")
            if name in shown:  # otherwise the observer has joined meanwhile
                trial = int(number)
                found.append(_answer(observers[name], trial, shown[name][trial], record))
        return sorted(found, key=lambda one: (observers[one.observer].number, one.trial))

    def forget(self, study_id: str, store: Blobs) -> None:
        """Remove the study, if it exists, with all its answers and pictures."""
        self._scripts.run(ForgetStudy(study=study_id))
        store.delete(*store.names(of_study(study_id)))


def orphans(client: RedisClient, store: Blobs) -> list[StoredBlob]:
    """The pictures that belong to no study, neither a made one nor one being made."""
    found: dict[str, list[StoredBlob]] = {}
    for blob in store.listing(_STUDIES):
        found.setdefault(blob.name.split("/")[1], []).append(blob)
    return [
        blob
        for study_id, stored in found.items()
        if not client.exists(keys.study(study_id), keys.study(study_id, "making"))
        for blob in stored
    ]


def of_study(study_id: str) -> str:
    """The prefix of the names of a study's pictures."""
    return f"{_STUDIES}{study_id}/"


def study_reference(study_id: str) -> str:
    """The blob of a study's reference."""
    return f"{of_study(study_id)}reference.png"


def study_level(study_id: str, spp: int) -> str:
    """The blob of a study's test image of `spp` samples per pixel."""
    return f"{of_study(study_id)}{spp:07d}.png"


def _digest(request: dict[str, Any], owner: str) -> str:
    text = json.dumps([request, owner], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def _study(fields: dict[str, str]) -> Study:
    return Study(
        **json.loads(fields["about"]),
        id=fields["id"],
        owner=fields["owner"] or None,
        created_at=moment(fields["created_at"]),
    )


def _observer(name: str, record: str) -> Observer:
    known = json.loads(record)
    screen = Screen.model_validate_json(known["screen"])
    joined_at = moment(known["joined_at"])
    return Observer(name=name, number=known["number"], screen=screen, joined_at=joined_at)


def _answer(observer: Observer, trial: int, pair: Pair, record: str) -> Answer:
    known = json.loads(record)
    given = json.loads(known["given"])
    return Answer(
        observer=observer.name,
        trial=trial,
        spp=pair.spp,
        reference=pair.reference,
        seen=given["seen"],
        seconds=given["seconds"],
        at=moment(known["at"]),
    )
