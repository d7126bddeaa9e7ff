"""The outbox of webhooks: messages that wait for their receivers, and how their tries ended.

The commands that change a job put a message into the outbox in the same step (``lua/outbox.lua``),
with the job as it was then. Any number of monitors deliver it: one at a time, by a lease, at least
once, always under the same id. Each receiver has its own queue, so that a silent one delays no
other.
"""

import base64
import json
import random
import secrets
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, Final

from plateau.farm.ledger import records
from plateau.farm.model.deliveries import Delivery, DeliveryTry
from plateau.farm.model.job import Job, moment
from plateau.farm.model.spec.webhook import SECRET_PREFIX, WebhookEvent
from plateau.farm.redis import keys
from plateau.farm.redis.client import RedisClient
from plateau.farm.redis.commands.webhooks import (
    DueDelivery,
    FarmSecrets,
    Redeliver,
    RenewFarmSecret,
    SettleDelivery,
    TakeDelivery,
    TryEnd,
)
from plateau.farm.redis.link import unavailable_as_farm_error
from plateau.farm.redis.scripts import Scripts

#: Tries before a message is given up: with the delays below, after a day or so.
MOST_TRIES: Final = 14
#: Seconds before the second try; the delay triples with each try, up to the longest.
_FIRST_DELAY_S: Final = 5.0
_LONGEST_DELAY_S: Final = 4 * 3600.0

#: For how long messages are also signed with the farm's former secret.
_OLD_SECRET_MS: Final = 86_400_000
_OLD_SECRETS: Final = 3


def retry_delay_s(tries: int, asked_s: float = 0.0) -> float:
    """Seconds to wait after this many failed tries, with a quarter of jitter.

    A receiver may ask for longer (``Retry-After``), up to four hours.
    """
    delay_s = min(_FIRST_DELAY_S * 3.0 ** (tries - 1), _LONGEST_DELAY_S)
    return max(delay_s * random.uniform(0.75, 1.25), min(asked_s, _LONGEST_DELAY_S))


def new_secret() -> str:
    """A secret to sign webhooks with, in the form of Standard Webhooks."""
    return SECRET_PREFIX + base64.b64encode(secrets.token_bytes(32)).decode()


def message_id(job_id: str, number: int) -> str:
    """The ``webhook-id`` of a job's message: the same at every try and redelivery."""
    return f"msg_{job_id}_{number}"


@dataclass(frozen=True, kw_only=True)
class Taken:
    """A delivery that is leased to its taker."""

    job_id: str
    number: int  #: of the job's messages, from 1
    event: WebhookEvent
    at: datetime  #: when it happened
    now: datetime  #: by Redis's clock
    tries: int  #: this one included
    receiver: str
    url: str = field(repr=False)  #: its path may be confidential
    secrets: tuple[str, ...] = field(repr=False)  #: each signs; none to a target
    token: str
    fields: dict[str, str] = field(repr=False)  #: the job's, as they were when it happened
    sealed: dict[str, str] = field(repr=False)  #: the job's that workers cannot change
    #: The number of jobs of the whole batch by state, where the message is about that.
    batch: Mapping[str, int] | None = None

    @property
    def id(self) -> str:
        """The message's ``webhook-id``."""
        return message_id(self.job_id, self.number)

    @property
    def target(self) -> str | None:
        """The name of the target that is notified; None where none is."""
        return _after(keys.NOTIFIED, self.receiver)

    @property
    def job(self) -> Job:
        """The job as it was when it happened."""
        return records.job(self.job_id, self.fields, self.sealed)


class Outbox:
    """All messages to webhooks. Every method raises `StoreUnavailable` when Redis is away."""

    def __init__(self, client: RedisClient) -> None:
        self._redis = client
        self._scripts = Scripts(client)

    def take(self, lease_s: float, busy: Iterable[str] = ()) -> Taken | None:
        """Lease the first due delivery to a receiver that is not busy; None without one.

        It becomes due again when the lease runs out. Deliveries of one job are tried one at a time,
        in the order of their events as long as none fails.
        """
        token = secrets.token_hex(8)
        lease_ms = round(lease_s * 1000)
        due = self._scripts.run(TakeDelivery(token=token, lease_ms=lease_ms, busy=tuple(busy)))
        if due is None:
            return None
        message = json.loads(due.delivery)
        return Taken(
            job_id=due.job,
            number=due.number,
            event=message["event"],
            at=moment(message["at"]),
            now=moment(due.now),
            tries=due.tries,
            receiver=due.receiver,
            url=due.url,
            secrets=self._secrets(due),
            token=token,
            fields={**message["job"], "spec": due.spec},
            sealed=due.sealed,
            batch=message.get("batch"),
        )

    def settle(
        self,
        taken: Taken,
        end: TryEnd,
        *,
        status: int | None,
        error: str,
        took_s: float,
        delay_s: float = 0.0,
    ) -> bool:
        """Report how the try ended; False where the lease was lost, and nothing was done.

        A ``failed`` one is tried again after `delay_s`. `status`, `error` and `took_s` are for the
        log.
        """
        answer = self._scripts.run(
            SettleDelivery(
                job=taken.job_id,
                number=taken.number,
                token=taken.token,
                end=end,
                delay_ms=round(delay_s * 1000),
                status=status,
                error=error,
                ms=round(took_s * 1000),
            )
        )
        return answer == "settled"

    def deliveries(self, job_id: str) -> list[Delivery]:
        """The job's newest hundred messages, by number, with their newest tries."""
        with unavailable_as_farm_error():
            pipe = self._redis.pipeline(transaction=True)
            pipe.hgetall(keys.job(job_id, "deliveries"))
            pipe.xrange(keys.job(job_id, "tries"))
            pipe.hget(keys.job(job_id), "webhook_receiver")
            found, tries, receiver = pipe.execute()
            numbers = sorted(int(field) for field in found if field.isdigit())
            to = [found.get(f"{number} receiver") or receiver for number in numbers]
            pipe = self._redis.pipeline(transaction=False)
            for number, one in zip(numbers, to, strict=True):
                pipe.zscore(keys.webhooks_due(one), f"{job_id}:{number}")
            due = pipe.execute()
        return [
            _delivery(job_id, number, found, at, tries, one)
            for number, at, one in zip(numbers, due, to, strict=True)
        ]

    def redeliver(self, job_id: str, number: int) -> Delivery | None:
        """Have a message tried now, whatever its state; None where the job has no such message."""
        if self._scripts.run(Redeliver(job=job_id, number=number)) == "unknown":
            return None
        return next((one for one in self.deliveries(job_id) if one.number == number), None)

    def _secrets(self, due: DueDelivery) -> tuple[str, ...]:
        if due.receiver.startswith(keys.NOTIFIED):
            return ()
        return (due.secret,) if due.secret else self.farm_secrets()

    def farm_secrets(self) -> tuple[str, ...]:
        """The secret for jobs without their own, and for a day those before it."""
        return tuple(self._scripts.run(FarmSecrets(secret=new_secret())).split())

    def renew_farm_secret(self) -> str:
        """Give the farm another secret; for a day messages are also signed with the former ones.

        With more than one, since a renewal whose answer was lost is repeated, and nobody has seen
        its secret.
        """
        renewed = new_secret()
        self._scripts.run(
            RenewFarmSecret(secret=renewed, signs_for_ms=_OLD_SECRET_MS, most=_OLD_SECRETS)
        )
        return renewed


def _after(prefix: str, receiver: str) -> str | None:
    return receiver.removeprefix(prefix) if receiver.startswith(prefix) else None


def _delivery(
    job_id: str,
    number: int,
    found: dict[str, str],
    due: float | None,
    tries: list[tuple[str, dict[str, str]]],
    receiver: str,
) -> Delivery:
    message = json.loads(found[str(number)])
    state: Any = found[f"{number} state"]
    if state == "waiting" and f"{number} token" in found:
        state = "trying"
    return Delivery(
        number=number,
        id=message_id(job_id, number),
        event=message["event"],
        target=_after(keys.NOTIFIED, receiver),
        at=moment(message["at"]),
        state=state,
        next_try_at=moment(due) if state == "waiting" and due is not None else None,
        tries=tuple(_try(fields) for _, fields in tries if fields["delivery"] == str(number)),
    )


def _try(fields: dict[str, str]) -> DeliveryTry:
    return DeliveryTry(
        at=moment(fields["at"]),
        status=int(fields["status"]) if fields["status"] else None,
        error=fields["error"] or None,
        ms=int(fields["ms"]) if fields["ms"] else None,
    )
