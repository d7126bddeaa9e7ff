"""The outbox: notices of ended jobs that wait for their receivers, and how their tries ended.

The step that ends a job's work puts its notices there (``lua/outbox.lua``). Any number of monitors
deliver them: each notice by one monitor at a time, by a lease, and at least once. Each receiver has
its own queue, so that a silent one delays no other.
"""

import json
import random
import secrets
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Final

from plateau.farm.ledger import records
from plateau.farm.model.job import Job, moment
from plateau.farm.redis.commands.notices import SettleNotice, TakeNotice, TryEnd
from plateau.farm.redis.scripts import OnRedis

#: Tries before a notice is given up: with the delays below, after a day or so.
MOST_TRIES: Final = 14
#: Seconds before the second try; the delay triples with each try, up to the longest.
_FIRST_DELAY_S: Final = 5.0
_LONGEST_DELAY_S: Final = 4 * 3600.0


def retry_delay_s(tries: int, asked_s: float = 0.0) -> float:
    """Seconds to wait after this many failed tries, with a quarter of jitter.

    A receiver may ask for longer (``Retry-After``), up to four hours.
    """
    delay_s = min(_FIRST_DELAY_S * 3.0 ** (tries - 1), _LONGEST_DELAY_S)
    return max(delay_s * random.uniform(0.75, 1.25), min(asked_s, _LONGEST_DELAY_S))


@dataclass(frozen=True, kw_only=True)
class Taken:
    """A notice that is leased to its taker."""

    job_id: str
    receiver: str  #: a target's name, or scheme, host and port of a URL
    tries: int  #: this one included
    now: datetime  #: by Redis's clock
    token: str
    fields: Mapping[str, str] = field(repr=False)  #: the job's,
    sealed: Mapping[str, str] = field(repr=False)  #: and those that workers cannot change

    @property
    def url(self) -> str | None:
        """Where it is POSTed, whose path may be confidential; None where it is for a target."""
        return self.sealed["notice_url"] if "://" in self.receiver else None

    @property
    def secret(self) -> str:
        """What signs a POST."""
        return self.sealed["notice_secret"]

    @property
    def job(self) -> Job:
        """The job that has ended."""
        return records.job(self.job_id, self.fields, self.sealed)

    @property
    def batch(self) -> dict[str, int] | None:
        """The number of jobs of the whole batch by state, where this job was the last of it."""
        found: dict[str, int] | None = json.loads(self.sealed.get("whole_batch", "null"))
        return found


class Outbox(OnRedis):
    """All notices that wait. Every method raises `StoreUnavailable` when Redis is away."""

    def take(self, lease_s: float, busy: Iterable[str] = ()) -> Taken | None:
        """Lease the first due notice to a receiver that is not busy; None without one.

        It becomes due again when the lease runs out.
        """
        token = secrets.token_hex(8)
        lease_ms = round(lease_s * 1000)
        due = self._scripts.run(TakeNotice(token=token, lease_ms=lease_ms, busy=tuple(busy)))
        if due is None:
            return None
        return Taken(
            job_id=due.job,
            receiver=due.receiver,
            tries=due.tries,
            now=moment(due.now),
            token=token,
            fields=_as_dict(due.fields),
            sealed=_as_dict(due.sealed),
        )

    def settle(self, taken: Taken, end: TryEnd, error: str = "", delay_s: float = 0.0) -> bool:
        """Report how the try ended; False where the lease was lost, and nothing was done.

        A ``failed`` one is tried again after `delay_s`.
        """
        answer = self._scripts.run(
            SettleNotice(
                job=taken.job_id,
                receiver=taken.receiver,
                token=taken.token,
                end=end,
                error=error,
                delay_ms=round(delay_s * 1000),
            )
        )
        return answer == "settled"


def _as_dict(found: tuple[str, ...]) -> dict[str, str]:
    return dict(zip(found[::2], found[1::2], strict=True))
