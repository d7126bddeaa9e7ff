"""The monitors' sweep: once an hour, one of them removes what nobody needs."""

import logging
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.totals import note_sweep
from plateau.farm.model.errors import FarmError
from plateau.farm.process.settings import Settings
from plateau.farm.redis.link import connect
from plateau.farm.sweep import Swept, in_seconds, is_due, sweep

_LOG = logging.getLogger(__name__)

_EVERY_S: Final = 3600.0  #: between two sweeps of the whole farm
_POLL_S: Final = 60.0  #: between two checks whether one is due


@contextmanager
def sweeping(settings: Settings, store: Blobs) -> Iterator[None]:
    """Run a thread that sweeps while the context lasts, through any error.

    The first monitor that finds a sweep due takes it. Its lock only saves work: two sweeps at once
    are harmless. A monitor that stops does not wait for its sweep, which may be cut short.
    """
    over = threading.Event()
    threading.Thread(
        target=_sweep_when_due, args=(settings, store, over), name="sweeper", daemon=True
    ).start()
    try:
        yield
    finally:
        over.set()


def _sweep_when_due(settings: Settings, store: Blobs, over: threading.Event) -> None:
    client = connect(settings.redis_url or "")
    while not over.wait(_POLL_S):
        try:
            if is_due(client, _EVERY_S):
                swept = sweep(
                    client,
                    store,
                    results_older_than_s=in_seconds(settings.keep_results_days),
                    deleted_older_than_s=in_seconds(settings.keep_deleted_days),
                    sums_older_than_s=in_seconds(settings.keep_sums_days),
                    scenes_unused_for_s=in_seconds(settings.keep_results_days),
                )
                note_sweep(client)
                _report(swept)
        except FarmError as error:
            _LOG.warning("the sweep is incomplete; the next is due in an hour: %s", error)
        except Exception:  # noqa: BLE001  (the monitor's jobs must continue)
            _LOG.exception("the sweep is incomplete; the next is due in an hour")


def _report(swept: Swept) -> None:
    if swept.blobs or swept.jobs or swept.deleted:
        _LOG.info(
            "swept %d old jobs, %d deleted ones, %d unused scenes and %d orphaned blobs: "
            "%d blobs, %d bytes in all",
            swept.jobs,
            swept.deleted,
            swept.scenes,
            swept.orphans,
            swept.blobs,
            swept.freed_bytes,
        )
