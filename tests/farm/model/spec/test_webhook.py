"""A spec's webhook: which URLs and secrets are taken, and that the secret is never shown."""

import base64
import json

import pytest
from pydantic import ValidationError

from plateau.farm.ledger.outbox import new_secret, retry_delay_s
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.spec.webhook import DEFAULT_EVENTS, WebhookSpec
from plateau.farm.process.settings import Settings

URL = "https://studio.example/hooks/plateau"


def secret_of(size: int) -> str:
    return "whsec_" + base64.b64encode(bytes(size)).decode()


def test_only_the_url_is_needed() -> None:
    spec = JobSpec.model_validate_json(json.dumps({"webhook": {"url": URL}}), strict=True)
    assert spec.webhook is not None
    assert spec.webhook.events == DEFAULT_EVENTS
    assert spec.webhook.secret is None


@pytest.mark.parametrize(
    ("url", "why"),
    [
        ("studio.example/hook", "must be like https://host/path"),
        ("ftp://studio.example/hook", "must be like https://host/path"),
        ("https:///hook", "must be like https://host/path"),
        ("https://me:word@studio.example/", "no user and no password"),
        ("https://me@studio.example/", "no user and no password"),
        ("https://studio.example/#top", "no #fragment"),
        ("https://studio.example/a b", "printable ASCII"),
        ("https://stüdio.example/", "printable ASCII"),
        ("https://studio.example/\nhost: other", "printable ASCII"),
        ("https://studio.example\\@10.0.0.1/", "printable ASCII"),
        ("https://studio.example:99999/", "is no URL"),
        ("https://studio.example:0/", "no port 0"),
        ("https://[::1/", "is no URL"),
        ("https://studio.example/" + "x" * 2000, "at most 2000"),
    ],
)
def test_a_url_that_is_none(url: str, why: str) -> None:
    with pytest.raises(ValidationError, match=why):
        WebhookSpec(url=url)


@pytest.mark.parametrize(
    ("url", "receiver"),
    [
        (URL, "https://studio.example:443"),
        ("https://Studio.Example:8443/x?token=1", "https://studio.example:8443"),
        ("http://10.0.0.7/", "http://10.0.0.7:80"),
    ],
)
def test_a_receiver_is_named_without_the_path(url: str, receiver: str) -> None:
    assert WebhookSpec(url=url).receiver == receiver


@pytest.mark.parametrize(
    "secret", [new_secret(), secret_of(24), secret_of(64)], ids=["new", "short", "long"]
)
def test_secrets_of_standard_webhooks(secret: str) -> None:
    assert WebhookSpec(url=URL, secret=secret).secret is not None


@pytest.mark.parametrize(
    "secret", ["", "swordfish", secret_of(23), secret_of(65), "whsec_%%%%", secret_of(32)[6:]]
)
def test_other_secrets_are_refused_and_not_repeated(secret: str) -> None:
    with pytest.raises(ValidationError, match="openssl rand") as refused:
        WebhookSpec(url=URL, secret=secret)
    if secret:
        assert secret not in str(refused.value)


def test_the_secret_is_shown_nowhere_but_in_the_request() -> None:
    secret = new_secret()
    spec = JobSpec.model_validate({"webhook": {"url": URL, "secret": secret}})
    for shown in (repr(spec), str(spec), spec.model_dump_json(), repr(spec.model_dump())):
        assert secret[6:] not in shown
    assert json.loads(spec.as_request())["webhook"]["secret"] == secret
    # What was shown is a spec again
    assert JobSpec.model_validate_json(spec.model_dump_json()).webhook is not None
    assert JobSpec().as_request() == "{}"


def test_unknown_events_are_refused() -> None:
    with pytest.raises(ValidationError, match="'queued', 'rendering'"):
        WebhookSpec.model_validate({"url": URL, "events": ["done"]})
    with pytest.raises(ValidationError, match="one at least"):
        WebhookSpec.model_validate({"url": URL, "events": []})


def test_retries_grow_to_hours_and_end_after_a_day() -> None:
    delays = [retry_delay_s(tries) for tries in range(1, 14)]
    assert 3 < delays[0] < 7
    assert all(delay <= 5 * 3600 for delay in delays)
    assert 18 * 3600 < sum(delays) < 31 * 3600
    # A receiver may ask for more time, but not for ever
    assert retry_delay_s(1, 600) == 600
    assert retry_delay_s(1, 10**9) == 4 * 3600


def test_private_receivers_are_allowed_by_the_setting(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PLATEAU_WEBHOOK_ALLOW", "10.0.0.0/8, hooks.lab,::1")
    assert Settings().webhook_allow == ("10.0.0.0/8", "hooks.lab", "::1")
    monkeypatch.setenv("PLATEAU_WEBHOOK_ALLOW", "http://hooks.lab/")
    with pytest.raises(ValidationError, match="neither a network"):
        Settings()
