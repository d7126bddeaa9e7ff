"""What Redis has of one job: its curve, events, results, plan, and the log of its slices."""

from collections.abc import Iterable, Mapping
from typing import Any

from plateau.farm.blobs import names as blobs
from plateau.farm.ledger import records
from plateau.farm.model.job import BEFORE_ALL_EVENTS, CurvePoint, Event, Job, LogEntry, moment
from plateau.farm.model.slices.plan import Plan
from plateau.farm.model.slices.rounds import Round
from plateau.farm.redis import keys
from plateau.farm.redis.scripts import OnRedis


class JobReads(OnRedis):
    """Reads of a job. Every method raises `StoreUnavailable` when Redis is away."""

    def curve(self, job_id: str) -> list[CurvePoint]:
        """The points of the job's curve, by rising spp."""
        entries = self._redis.xrange(keys.job(job_id, "curve"))
        return [records.curve_point(fields["point"], fields["at"]) for _, fields in entries]

    def events(self, job_id: str, after: str = BEFORE_ALL_EVENTS) -> list[Event]:
        """The job's events after the event `after`."""
        entries = self._redis.xrange(keys.job(job_id, "events"), min=f"({after}")
        return [records.event(event_id, fields) for event_id, fields in entries]

    def story(self, job_id: str) -> tuple[str, ...]:
        """Each transition of the job in words, with its time and its cause."""
        return tuple(
            f"{happening.at:%Y-%m-%d %H:%M:%S} {happening.data['to']}: {happening.data['reason']}"
            for happening in self.events(job_id)
            if happening.type == "state"
        )

    def results(self, job_id: str) -> str:
        """The blob prefix of the job's last results; "" where it has none yet."""
        return self._redis.hget(keys.job(job_id), "results") or ""

    def sha256(self, blob: str) -> str | None:
        """The SHA-256 of a job's result or preview; None where the blob went."""
        job_id, name = blobs.in_job(blob)
        return self._redis.hget(keys.job(job_id, "digests"), name)

    def plan(self, job: Job) -> Plan:
        """What each slice of the job has, as far as it is decided."""
        stored: list[str] = []
        if job.spec.by_zones:
            stored = self._redis.zrange(keys.job(job.id, "rounds"), 0, -1)
        has_looks = job.spec.is_denoised and not job.spec.by_zones
        points = self.curve(job.id) if has_looks else []
        return Plan.of(
            job.spec,
            job.width,
            job.height,
            map(Round.from_json, stored),
            [(point.spp, point.expected_spp) for point in points],
        )

    def ledger(self, job_id: str) -> dict[int, dict[str, Any]]:
        """Each committed slice's record, by index, in order."""
        return records.ledger(self._redis.hgetall(keys.job(job_id, "ledger")))

    def log(self, job_id: str, index: int | None = None) -> list[LogEntry]:
        """How each try of a slice ended, or of this one; the newest 2000 or so that were noted."""
        pipe = self._redis.pipeline(transaction=True)
        pipe.xrange(keys.job(job_id, "log"))
        pipe.hgetall(keys.job(job_id, "ledger"))
        entries, committed = pipe.execute()
        wanted = None if index is None else str(index)
        written = (one for _, one in entries if wanted in {None, one["slice"]})
        ledger = {at: one for at, one in committed.items() if wanted in {None, at}}
        return slice_log(written, records.ledger(ledger))


def slice_log(
    written: Iterable[Mapping[str, str]], ledger: Mapping[int, Mapping[str, Any]]
) -> list[LogEntry]:
    """The written entries and those from the ledger, by time.

    `ledger` has the committed slices' records by index, read in the same moment. The commands write
    an entry in the same step in which they decide, so that log and ledger never disagree. A slice
    that was committed without output has no entry: its ledger record serves as one.
    """
    entries = [_entry(fields) for fields in written]
    # A slice may be committed again after its partial was rejected.
    last = {entry.slice: entry.what for entry in entries if entry.what in {"committed", "rejected"}}
    silent = (record for index, record in ledger.items() if last.get(index) != "committed")
    return sorted([*entries, *map(_committed, silent)], key=lambda entry: entry.at)


def _entry(fields: Mapping[str, str]) -> LogEntry:
    return LogEntry.model_validate(
        {
            "at": moment(fields["at"]),
            "slice": fields["slice"],
            "worker": fields["worker"],
            "what": fields["what"],
            "cause": fields["cause"] or None,
            "seconds": float(fields["ms"]) / 1000 if fields["ms"] else None,
            "text": fields["text"],
        }
    )


def _committed(record: Mapping[str, Any]) -> LogEntry:
    return LogEntry(
        at=moment(record["at"]),
        slice=record["index"],
        worker=record["worker"],
        what="committed",
        seconds=record["render_s"],
    )
