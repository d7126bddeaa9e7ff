"""`plateau webhooks list | redeliver`, and the webhooks of `submit` and `show`."""

import os
from collections.abc import Sequence

from pydantic import ValidationError

from plateau.client import Client
from plateau.commands.connect import connect
from plateau.errors import CommandFailed
from plateau.farm.model import input_errors
from plateau.farm.model.deliveries import Delivery
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.spec.webhook import WebhookSpec
from plateau.farm.wire.views import JobView
from plateau.terminal.tables import print_rows

_COLUMNS = ("number", "event", "happened (UTC)", "state", "tries", "last answer", "next (UTC)")
_SECRET = "PLATEAU_WEBHOOK_SECRET"


def with_webhook(spec: JobSpec, url: str | None, events: Sequence[str]) -> JobSpec:
    """The spec with this webhook, whose secret is read from the environment."""
    if url is None:
        if events:
            raise CommandFailed("--webhook-event chooses what --webhook URL receives: give both")
        return spec
    asked: dict[str, object] = {"url": url, "secret": os.environ.get(_SECRET) or None}
    if events:
        asked["events"] = tuple(events)
    try:
        return spec.model_copy(update={"webhook": WebhookSpec.model_validate(asked)})
    except ValidationError as error:
        found = error.errors()[0]
        names = {"url": "--webhook", "events": "--webhook-event", "secret": _SECRET}
        name = names[str(found["loc"][0])]
        raise CommandFailed(f"{name}: {input_errors.message(found)}") from None


def with_targets(spec: JobSpec, names: Sequence[str] | None) -> JobSpec:
    """The spec with these targets of notifications, where there are any."""
    if not names:
        return spec
    try:
        asked = JobSpec.model_validate({"notify": tuple(names)})
    except ValidationError as error:
        raise CommandFailed(f"--notify: {input_errors.message(error.errors()[0])}") from None
    return spec.model_copy(update={"notify": asked.notify})


def undelivered(client: Client, job: JobView) -> list[str]:
    """A line for each message about the job that was tried and not delivered."""
    if job.spec.webhook is None and not job.spec.notify:
        return []
    return [
        f"{one.number} ({_what(one)}): {one.state.replace('-', ' ')} after {_tries(one)}, "
        f"{_next(one)}: {one.tries[-1].error}"
        for one in client.webhooks(job.id).deliveries
        if one.state != "delivered" and one.tries
    ]


def list_deliveries(job_id: str, *, url: str | None, as_json: bool) -> None:
    """Print the messages to a job's webhook."""
    with connect(url) as client:
        found = client.webhooks(client.whole_id(job_id))
    if as_json:
        print(found.model_dump_json(indent=2))
        return
    none = "no message yet" if found.url else "the job has no webhook"
    print_rows(_COLUMNS, list(map(_row, found.deliveries)), none=none)


def redeliver(job_id: str, number: int, *, url: str | None, as_json: bool) -> None:
    """Send a message again."""
    with connect(url) as client:
        found = client.redeliver(client.whole_id(job_id), number)
    print(found.model_dump_json(indent=2) if as_json else f"{found.id} {found.state}")


def _row(one: Delivery) -> tuple[str, ...]:
    last = one.tries[-1] if one.tries else None
    return (
        str(one.number),
        _what(one),
        f"{one.at:%Y-%m-%d %H:%M:%S}",
        one.state,
        str(len(one.tries)),
        "–" if last is None else last.error or str(last.status or "taken"),
        "–" if one.next_try_at is None else f"{one.next_try_at:%Y-%m-%d %H:%M:%S}",
    )


def _what(one: Delivery) -> str:
    return one.event if one.target is None else f"{one.event} → {one.target}"


def _tries(one: Delivery) -> str:
    return "1 try" if len(one.tries) == 1 else f"{len(one.tries)} tries"


def _next(one: Delivery) -> str:
    if one.state == "given-up":
        return "`plateau webhooks redeliver` sends it again"
    if one.next_try_at is None:
        return "being tried"
    return f"next at {one.next_try_at:%Y-%m-%d %H:%M:%S} UTC"
