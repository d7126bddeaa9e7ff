"""Gives up a job that cannot go on, however little of it can be read."""

import logging

from plateau.farm.ledger.ownership import Ownership, Ownerships
from plateau.farm.model.errors import FenceLost, IllegalTransition
from plateau.farm.model.states import JobState

_LOG = logging.getLogger(__name__)


def give_up(owned: Ownership, owners: Ownerships, reason: str) -> bool:
    """Fail the job; returns whether its monitor has done with it.

    Where it had ended before, it is left without its last results. One that Redis has lost is
    dropped, or every monitor would come upon it again.

    Raises
    ------
    StoreUnavailable
        Call again later.
    """
    try:
        state = owners.state(owned.job_id)
        if state is None:
            _LOG.error("Redis has lost the job, so no monitor works on it any more")
            owners.abandon(owned)
            return True
        if state.ended:
            owners.finish(owned, keeps_sums=False)
            return True
        owners.end(owned, JobState.FAILED, reason)
    except FenceLost:
        return True
    except IllegalTransition as refused:
        _LOG.info("%s", refused)  # it was cancelled a moment ago
    return False
