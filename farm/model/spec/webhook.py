"""A job's webhook, as its user asks for it."""

import base64
import binascii
import re
from typing import Final, Literal, get_args
from urllib.parse import SplitResult, urlsplit

from pydantic import BaseModel, ConfigDict, Field, SecretStr, field_validator

WebhookEvent = Literal[
    "queued", "rendering", "paused", "converged", "exhausted", "cancelled", "failed", "finished"
]

#: All but ``queued``, which is no news to the user who submits the job.
DEFAULT_EVENTS: Final[tuple[WebhookEvent, ...]] = get_args(WebhookEvent)[1:]

SECRET_PREFIX: Final = "whsec_"
_SECRET_BYTES: Final = range(24, 65)  # as Standard Webhooks has it
_PORTS: Final = {"https": 443, "http": 80}
#: Shown in place of a hidden path. ASCII, as clients read the whole as a URL.
_HIDDEN: Final = "/..."


class WebhookSpec(BaseModel):
    """Who is told of a job's changes, in requests signed as Standard Webhooks has it."""

    model_config = ConfigDict(frozen=True, extra="forbid", hide_input_in_errors=True)

    url: str = Field(
        max_length=2000,
        description="where a message is POSTed: https; a private address, or http, only where the "
        "farm's PLATEAU_WEBHOOK_ALLOW names it",
        json_schema_extra={"pattern": "^https?://"},
        examples=["https://studio.example/hooks/plateau"],
    )
    events: tuple[WebhookEvent, ...] = Field(
        default=DEFAULT_EVENTS,
        max_length=len(DEFAULT_EVENTS) + 1,
        description="the states to report, and `finished`: all results are written",
        json_schema_extra={"minItems": 1},
    )
    # Excluded wherever a spec is written, except in `JobSpec.as_request`.
    secret: SecretStr | None = Field(
        default=None,
        exclude=True,
        description="signs the messages: `whsec_` and the base64 of 24 to 64 random bytes; without "
        "one the farm's own does. It is never shown again",
    )

    @field_validator("url")
    @classmethod
    def _a_url_to_post_to(cls, url: str) -> str:
        if not re.fullmatch(r"[\x21-\x7e]+", url) or "\\" in url:
            raise ValueError("must be printable ASCII without spaces or backslashes")
        try:
            parts = urlsplit(url)
            _ = parts.port
        except ValueError as error:
            raise ValueError(f"is no URL: {error}") from None
        if parts.scheme not in _PORTS or not parts.hostname:
            raise ValueError("must be like https://host/path")
        if "@" in parts.netloc:
            raise ValueError(
                "must name no user and no password: the receiver knows the farm by its signature"
            )
        if parts.fragment:
            raise ValueError("must have no #fragment: nobody would receive it")
        if parts.port == 0:
            raise ValueError("must name no port 0")
        return url

    @field_validator("events")
    @classmethod
    def _at_least_one(cls, events: tuple[WebhookEvent, ...]) -> tuple[WebhookEvent, ...]:
        if not events:
            raise ValueError("must be one at least: without any, nobody would be told anything")
        return events

    @field_validator("secret")
    @classmethod
    def _a_secret_of_standard_webhooks(cls, secret: SecretStr | None) -> SecretStr | None:
        if secret is not None and not _is_secret(secret.get_secret_value()):
            raise ValueError(
                "must be whsec_ and the base64 of 24 to 64 random bytes, as "
                "`echo whsec_$(openssl rand -base64 32)` makes one"
            )
        return secret

    @property
    def parts(self) -> SplitResult:
        """The parts of the URL."""
        return urlsplit(self.url)

    @property
    def receiver(self) -> str:
        """Scheme, host and port, without the path, which may be confidential."""
        parts = self.parts
        return f"{parts.scheme}://{parts.hostname}:{parts.port or _PORTS[parts.scheme]}"

    @property
    def is_hidden(self) -> bool:
        """Whether this is a `hidden` webhook, whose URL leads nowhere."""
        return self.url.endswith(_HIDDEN) and self.parts.path == _HIDDEN

    def hidden(self) -> "WebhookSpec":
        """The webhook without its secret and its path, which is often the only protection."""
        return self.model_copy(
            update={"url": f"{self.parts.scheme}://{self.parts.netloc}{_HIDDEN}", "secret": None}
        )


def _is_secret(text: str) -> bool:
    try:
        key = base64.b64decode(text.removeprefix(SECRET_PREFIX), validate=True)
    except (binascii.Error, ValueError):
        return False
    return text.startswith(SECRET_PREFIX) and len(key) in _SECRET_BYTES
