"""Fetches the partials of committed slices, and checks each against its record in the ledger."""

import hashlib
import logging
from collections.abc import Iterable
from typing import Final

from plateau.farm.blobs import names as blobs
from plateau.farm.blobs.read_ahead import ReadAhead, Series
from plateau.farm.blobs.store import Blobs
from plateau.farm.images.exr import Partial, decode_partial
from plateau.farm.ledger.ownership import Ownership, Ownerships
from plateau.farm.ledger.queue import SliceRecord
from plateau.farm.model.aovs import AOVS
from plateau.farm.model.errors import CorruptPartial
from plateau.farm.model.slices.plan import Plan
from plateau.farm.model.slices.rounds import slice_zones
from plateau.farm.model.slices.zones import pixels_of
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.states import MAX_TRIES
from plateau.farm.process.log import concerning

#: The most pixels to which a sample may contribute beyond its own.
_MOST_BORDER: Final = 16

_LOG = logging.getLogger(__name__)


def checked_partial(store: Blobs, blob: str, sha256: str) -> Partial:
    """Return a partial, as its worker uploaded it.

    Raises
    ------
    FileNotFoundError
        The blob store does not have it.
    CorruptPartial
        Its bytes are not those that the worker uploaded.
    """
    if not blobs.is_partial(blob):
        raise CorruptPartial(f"{blob!r} is no partial's name")
    content = store.get(blob)
    if hashlib.sha256(content).hexdigest() != sha256:
        raise CorruptPartial(f"{blob} is not what its worker uploaded")
    return decode_partial(content)


class Films:
    """The partials of a job's slices, for the monitor that owns the job."""

    def __init__(
        self, owned: Ownership, owners: Ownerships, store: Blobs, ahead: ReadAhead, spec: JobSpec
    ) -> None:
        self._spec = spec
        self._owned = owned
        self._owners = owners
        self._series: Series[tuple[str, str], Partial] = Series(
            ahead,
            lambda named: checked_partial(store, *named),
            lambda partial: partial.pixels.nbytes,
        )

    def expect(self, records: Iterable[SliceRecord]) -> None:
        """Say of which slices the partials come next, in their order."""
        self._series.expect((one.blob, one.sha256) for one in records)

    def let_go(self) -> None:
        """Keep no partial in memory until the next is asked for."""
        self._series.let_go()

    def partial(self, record: SliceRecord, plan: Plan) -> Partial | None:
        """Return the slice's partial, or None if it is lost, is damaged or lacks AOVs.

        It is damaged, too, if it has not the zones and the spp of the plan. The slice is then
        rendered again, unless the job has ended.

        Raises
        ------
        CorruptPartial
            The slice was rendered too often.
        """
        with concerning(self._owned.job_id, record.index):
            try:
                partial = self._series.get((record.blob, record.sha256))
                self._check_zones(partial, plan)
                return self._complete(partial, record)
            except FileNotFoundError as error:
                self._render_again(record, f"the blob store has no {record.blob}", error)
            except CorruptPartial as error:
                self._render_again(record, str(error), error)
            return None

    def _check_zones(self, partial: Partial, plan: Plan) -> None:
        as_planned = partial.spp == plan.slice_spp_of(partial.index)
        if not (as_planned and self._has_its_zones(partial, plan)):
            raise CorruptPartial(
                f"slice {partial.index} has {partial.spp} spp of {len(partial.zones)} zones, and "
                "the plan says otherwise"
            )

    def _has_its_zones(self, partial: Partial, plan: Plan) -> bool:
        zones, border = partial.zones, partial.border
        if not zones:
            return not slice_zones(self._spec, plan.slice_round(partial.index), 1, 1, border)
        # A worker may say anything: what it says must not make a grid without end.
        if not 0 <= border <= _MOST_BORDER or min(min(zone[2:]) for zone in zones) < 1:
            return False
        width = plan.width or max(zone.x + zone.width for zone in zones)
        height = plan.height or max(zone.y + zone.height for zone in zones)
        one, pixels = plan.slice_round(partial.index), pixels_of(zones)
        is_whole = one is None or one.zones is None
        if pixels > len(partial.pixels) or (is_whole and pixels != width * height):
            return False
        return zones == slice_zones(self._spec, one, width, height, border)

    def _complete(self, partial: Partial, record: SliceRecord) -> Partial:
        aovs = self._spec.slice_aovs(record.index)
        expected = {channel for aov in aovs for channel in AOVS[aov].channels}
        lacking = expected.difference(partial.channels.names)
        if lacking:
            raise CorruptPartial(
                f"slice {record.index} lacks the channels {', '.join(sorted(lacking))}: worker "
                f"{record.worker} is older than AOVs, so upgrade it"
            )
        return partial

    def _render_again(self, record: SliceRecord, cause: str, error: Exception) -> None:
        _LOG.warning("%s", cause)
        if self._owners.reject(self._owned, record, cause) > MAX_TRIES:
            raise CorruptPartial(
                f"slice {record.index} was rendered {MAX_TRIES + 1} times and its partial never "
                f"came back whole: {cause}"
            ) from error
