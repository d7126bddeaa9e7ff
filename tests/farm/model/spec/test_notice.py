"""A spec's notice: which URLs and secrets are taken, and that the secret is never shown."""

import base64
import json

import pytest
from pydantic import ValidationError

from plateau.farm.model.spec import JobSpec
from plateau.farm.model.spec.notice import NoticeSpec
from plateau.farm.process.settings import Settings

URL = "https://studio.example/hooks/plateau"


def secret_of(size: int) -> str:
    return "whsec_" + base64.b64encode(bytes(size)).decode()


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
        NoticeSpec(url=url)


@pytest.mark.parametrize(
    ("url", "receiver"),
    [
        (URL, "https://studio.example:443"),
        ("https://Studio.Example:8443/x?token=1", "https://studio.example:8443"),
        ("http://10.0.0.7/", "http://10.0.0.7:80"),
    ],
)
def test_a_receiver_is_named_without_the_path(url: str, receiver: str) -> None:
    assert NoticeSpec(url=url, targets=("ops",)).receivers == (receiver, "ops")
    assert NoticeSpec().receivers == ()


@pytest.mark.parametrize("secret", [secret_of(24), secret_of(64)], ids=["short", "long"])
def test_secrets_of_standard_webhooks(secret: str) -> None:
    assert NoticeSpec(url=URL, secret=secret).secret is not None


@pytest.mark.parametrize(
    "secret", ["", "swordfish", secret_of(23), secret_of(65), "whsec_%%%%", secret_of(32)[6:]]
)
def test_other_secrets_are_refused_and_not_repeated(secret: str) -> None:
    with pytest.raises(ValidationError, match="openssl rand") as refused:
        NoticeSpec(url=URL, secret=secret)
    if secret:
        assert secret not in str(refused.value)


def test_the_secret_is_shown_nowhere_but_in_the_request() -> None:
    secret = secret_of(32)
    spec = JobSpec.model_validate({"notice": {"url": URL, "secret": secret}})
    for shown in (repr(spec), str(spec), spec.model_dump_json(), repr(spec.model_dump())):
        assert secret[6:] not in shown
    assert json.loads(spec.as_request())["notice"]["secret"] == secret
    # What was shown is a spec again
    assert JobSpec.model_validate_json(spec.model_dump_json()).notice.url == URL
    assert JobSpec().as_request() == "{}"


def test_private_receivers_are_allowed_by_the_setting(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PLATEAU_WEBHOOK_ALLOW", "10.0.0.0/8, hooks.lab,::1")
    assert Settings().webhook_allow == ("10.0.0.0/8", "hooks.lab", "::1")
    monkeypatch.setenv("PLATEAU_WEBHOOK_ALLOW", "http://hooks.lab/")
    with pytest.raises(ValidationError, match="neither a network"):
        Settings()
