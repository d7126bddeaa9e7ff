"""A monitor's jobs: own one, plan its slices, extend its curve, end it.

A job has one owner at a time: a lease in Redis with a fencing token. Every write below carries
the token and is refused, with `FenceLost`, once another monitor has taken over.
"""

import json
from collections.abc import Mapping

from plateau.farm.blobs import names as blobs
from plateau.farm.ledger.queue import SliceRecord
from plateau.farm.ledger.records import slice_record
from plateau.farm.model.errors import FenceLost, IllegalTransition
from plateau.farm.model.record import Record
from plateau.farm.model.shot import FrameWait
from plateau.farm.model.slices.rounds import Round
from plateau.farm.model.states import EndedBy, JobState
from plateau.farm.redis import keys
from plateau.farm.redis.client import RedisClient
from plateau.farm.redis.commands.command import Reply
from plateau.farm.redis.commands.jobs import DecidedRound, End
from plateau.farm.redis.commands.owners import (
    Abandon,
    AppendPoint,
    Conclude,
    Disown,
    Finish,
    NoteBlob,
    Own,
    OwnerCommand,
    Plan,
    Reject,
    Renew,
    Save,
    Show,
)
from plateau.farm.redis.commands.owners import Ownership as Ownership
from plateau.farm.redis.link import now_ms
from plateau.farm.redis.scripts import OnRedis


class Checkpoint(Record):
    """The sums of a job's first slices."""

    blob: str  #: its name in the blob store
    sha256: str  #: of its bytes
    slices: int  #: the number of slices in the sums


class Ownerships(OnRedis):
    """What a monitor may do with jobs. Methods raise `StoreUnavailable` and `FenceLost`."""

    def __init__(self, client: RedisClient, lease_s: float) -> None:
        super().__init__(client)
        self._lease_ms = round(lease_s * 1000)

    def unfinished(self) -> set[str]:
        """The jobs that still need a monitor."""
        return set(self._redis.smembers(keys.UNFINISHED))

    def monitors(self) -> int:
        """The number of living monitors."""
        return len(self._redis.zrangebyscore(keys.MONITORS, now_ms(self._redis), "+inf"))

    def by_age(self, job_ids: set[str]) -> list[str]:
        """These jobs, the oldest first."""
        if not job_ids:
            return []
        numbers = self._redis.zmscore(keys.JOBS, sorted(job_ids))
        known = zip(numbers, sorted(job_ids), strict=True)
        return [job_id for _, job_id in sorted(one for one in known if one[0] is not None)]

    def acquire(self, job_id: str) -> Ownership | None:
        """Own the job, or None where another monitor does."""
        token = self._scripts.run(Own(job=job_id, lease_ms=self._lease_ms))
        return Ownership(job_id, token) if token else None

    def renew(self, owned: tuple[Ownership, ...]) -> set[str]:
        """Renew the leases of these jobs; returns the jobs that were lost."""
        lost = self._scripts.run(Renew(lease_ms=self._lease_ms, owned=owned))
        return set(lost)

    def disown(self, owned: tuple[Ownership, ...]) -> None:
        """Give up these jobs for the next monitor."""
        self._scripts.run(Disown(owned=owned))

    def committed(self, job_id: str, indices: range) -> list[SliceRecord]:
        """The ledger's records of these slices, up to the first missing one."""
        if not indices:
            return []
        texts = self._redis.hmget(keys.job(job_id, "ledger"), [str(i) for i in indices])
        records = []
        for text in texts:
            if text is None:
                break
            records.append(SliceRecord.model_validate(slice_record(text)))
        return records

    def state(self, job_id: str) -> JobState | None:
        """The job's state, even of an unreadable job; None where Redis has lost the job."""
        state = self._redis.hget(keys.job(job_id), "state")
        return None if state is None else JobState(state)

    def checkpoint(self, job_id: str) -> Checkpoint | None:
        """The job's last checkpoint, if it has one."""
        text = self._redis.hget(keys.job(job_id), "checkpoint")
        return None if text is None else Checkpoint.model_validate_json(text)

    def save_checkpoint(
        self, owned: Ownership, checkpoint: Checkpoint, waits: FrameWait | None = None
    ) -> None:
        """Note the job's last checkpoint, and that it waits with that for a look at its shot."""
        self._checked(
            Save(
                job=owned.job_id,
                token=owned.token,
                checkpoint=checkpoint.model_dump_json(),
                waits=None if waits is None else waits.model_dump_json(),
            )
        )

    def glimpse(self, job_id: str) -> str | None:
        """The blob of the first pass of the job's first slice, as long as it has no results."""
        blob, results = self._redis.hmget(keys.job(job_id), "glimpse", "results")
        return None if results else blob

    def show_results(
        self, owned: Ownership, results: str, spp: int, sha256: Mapping[str, str] | None = None
    ) -> None:
        """Note the blob prefix of the job's last set of results, and its spp.

        `sha256` has the digest of each file of the set by its name.
        """
        digests = _digests(results, sha256)
        self._checked(
            Show(job=owned.job_id, token=owned.token, results=results, spp=spp, digests=digests)
        )

    def note_blob(self, owned: Ownership, blob: str, sha256: str | None) -> None:
        """Note the digest of a blob before it is put; None forgets a blob that went."""
        name = blobs.in_job(blob)[1]
        self._checked(NoteBlob(job=owned.job_id, token=owned.token, blob=name, sha256=sha256))

    def reject(self, owned: Ownership, record: SliceRecord, cause: str) -> int:
        """Have a slice with a lost or spoiled partial rendered again.

        Returns how often that has happened to the slice; 0, with nothing done, where the ledger has
        another record or the job has ended.
        """
        times = self._checked(
            Reject(
                job=owned.job_id,
                token=owned.token,
                index=record.index,
                blob=record.blob,
                cause=cause,
            )
        )
        return times or 0

    def plan(self, owned: Ownership, slices: range, expected_spp: int | None = None) -> None:
        """Let all slices up to the last of these be leased; planned ones are left alone.

        `expected_spp`, where the job is expected to end, tells the census how much work is left.
        """
        self._checked(
            Plan(job=owned.job_id, token=owned.token, stop=slices.stop, expected_spp=expected_spp)
        )

    def append_point(
        self,
        owned: Ownership,
        spp: int,
        point: dict[str, object],
        decided: Round | None = None,
        *,
        is_last: bool = False,
    ) -> None:
        """Append a point to the curve, once for each spp.

        `decided` is the round that its image decides; both are stored together. After the point
        that `is_last` the job needs no more samples, which is an event.
        """
        stored = None if decided is None else DecidedRound(decided.first, decided.as_json())
        self._checked(
            AppendPoint(
                job=owned.job_id,
                token=owned.token,
                spp=spp,
                point=json.dumps(point),
                round=stored,
                is_last=is_last,
            )
        )

    def end(
        self,
        owned: Ownership,
        target: JobState,
        ended_by: EndedBy,
        reason: str,
        verdict: dict[str, float | None] | None = None,
        results: str = "",
        sha256: Mapping[str, str] | None = None,
        notes: tuple[str, ...] | None = None,
    ) -> None:
        """End the job; its remaining slices are withdrawn.

        `verdict` has the numbers of the rule that fired. If the last results are written already,
        `results` is their blob prefix, `sha256` has the digest of each file by its name, `notes`
        say how it was rendered, and the job is concluded, too.

        Raises
        ------
        IllegalTransition
            The job has ended otherwise in the meantime: it was cancelled, or it failed.
        """
        moved = self._scripts.run(
            End(
                job=owned.job_id,
                token=owned.token,
                target=target,
                ended_by=ended_by,
                reason=reason,
                verdict=None if verdict is None else json.dumps(verdict),
                results=results,
                digests=_digests(results, sha256),
                notes=None if notes is None else json.dumps(notes),
            )
        )
        if moved.outcome == "fenced":
            raise FenceLost(owned.job_id)
        if moved.outcome == "illegal":
            raise IllegalTransition(owned.job_id, moved.state, target)

    def conclude(
        self,
        owned: Ownership,
        *,
        spp: int,
        results: str,
        sha256: Mapping[str, str] | None = None,
        notes: tuple[str, ...],
        spp_range: tuple[int, int] | None = None,
    ) -> None:
        """Note that the results of an ended job are written: its other blobs may go.

        `results` is their blob prefix, or "" without results. `sha256` has the digest of each file
        by its name; None where `show_results` has noted them. `spp_range` is the least and the most
        that a zone has, where it is not that of the newest point.
        """
        self._checked(
            Conclude(
                job=owned.job_id,
                token=owned.token,
                spp=spp,
                results=results,
                digests=_digests(results, sha256),
                notes=json.dumps(notes),
                spp_range=spp_range,
            )
        )

    def concluded(self, job_id: str) -> bool:
        """Whether the job's last results are written."""
        return bool(self._redis.hexists(keys.job(job_id), "concluded"))

    def finish(self, owned: Ownership, *, keeps_sums: bool) -> None:
        """Note that the job's other blobs were cleared: it needs no monitor any more.

        `keeps_sums` leaves its last checkpoint for a job that continues it.
        """
        self._checked(Finish(job=owned.job_id, token=owned.token, keeps_sums=keeps_sums))

    def abandon(self, owned: Ownership) -> None:
        """Note that Redis has lost the job: it needs no monitor any more."""
        self._checked(Abandon(job=owned.job_id, token=owned.token))

    def _checked(self, command: OwnerCommand[Reply]) -> Reply:
        answer = self._scripts.run(command)
        if answer in {"fenced", None}:
            raise FenceLost(command.job)
        return answer


def _digests(results: str, sha256: Mapping[str, str] | None) -> dict[str, str] | None:
    """The digests of a set of results by blob; None where there are none."""
    if not sha256:
        return None
    _, folder = blobs.in_job(results)
    return {f"{folder}/{name}": digest for name, digest in sha256.items()}
