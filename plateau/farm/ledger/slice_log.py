"""A job's log: how each try of a slice ended, and the render child's output.

The commands write an entry in the same step in which they decide, so that log and ledger never
disagree. A slice that was committed without output has no entry: its ledger record serves as one.
"""

from collections.abc import Iterable, Mapping
from typing import Any

from plateau.farm.model.job import LogEntry, moment


def slice_log(
    written: Iterable[Mapping[str, str]], ledger: Mapping[int, Mapping[str, Any]]
) -> list[LogEntry]:
    """The written entries and those from the ledger, by time.

    `ledger` has the committed slices' records by index, read in the same moment.
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
