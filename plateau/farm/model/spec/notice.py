"""Who hears that a job has ended, as its user asks for it."""

import base64
import re
from typing import Any, Final
from urllib.parse import SplitResult, urlsplit

from pydantic import BaseModel, ConfigDict, Field, SecretStr, field_validator

from plateau.farm.model.place_names import Tags

SECRET_PREFIX: Final = "whsec_"
_SECRET_BYTES: Final = range(24, 65)  # as Standard Webhooks has it
_PORTS: Final = {"https": 443, "http": 80}
#: Shown in place of a hidden path. ASCII, as clients read the whole as a URL.
_HIDDEN: Final = "/..."


class NoticeSpec(BaseModel):
    """Who is notified when the job ends: a URL, by a signed POST, and the operator's targets."""

    model_config = ConfigDict(frozen=True, extra="forbid", hide_input_in_errors=True)

    url: str | None = Field(
        default=None,
        max_length=2000,
        description="where a message is POSTed: https; a private address, or http, only where the "
        "farm's PLATEAU_WEBHOOK_ALLOW names it",
        json_schema_extra={"pattern": "^https?://"},
        examples=["https://studio.example/hooks/plateau"],
    )
    # Excluded wherever a spec is written, except in `as_request`.
    secret: SecretStr | None = Field(
        default=None,
        exclude=True,
        description="signs that message, as Standard Webhooks has it: `whsec_` and the base64 of "
        "24 to 64 random bytes. A URL needs one; it is never shown again",
    )
    targets: Tags = Field(
        default=(),
        description="names of targets that are notified when the job, or the whole of its batch, "
        "has ended; the farm's operator names them",
    )

    @field_validator("url")
    @classmethod
    def _a_url_to_post_to(cls, url: str | None) -> str | None:
        if url is None:
            return None
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

    @field_validator("secret")
    @classmethod
    def _a_secret_of_standard_webhooks(cls, secret: SecretStr | None) -> SecretStr | None:
        if secret is not None and not _is_secret(secret.get_secret_value()):
            raise ValueError(
                "must be whsec_ and the base64 of 24 to 64 random bytes, as "
                "`echo whsec_$(openssl rand -base64 32)` makes one"
            )
        return secret

    def as_request(self) -> dict[str, Any]:
        """The notice as JSON values, its secret included: never to be stored, nor shown."""
        secret = {} if self.secret is None else {"secret": self.secret.get_secret_value()}
        return self.model_dump(mode="json") | secret

    @property
    def receivers(self) -> tuple[str, ...]:
        """Scheme, host and port of the URL, whose path may be confidential, and the targets."""
        if self.url is None:
            return self.targets
        parts = self._parts
        port = parts.port or _PORTS[parts.scheme]
        return (f"{parts.scheme}://{parts.hostname}:{port}", *self.targets)

    @property
    def is_hidden(self) -> bool:
        """Whether this is a `hidden` notice, whose URL leads nowhere."""
        return self.url is not None and self.url.endswith(_HIDDEN) and self._parts.path == _HIDDEN

    def hidden(self) -> "NoticeSpec":
        """The notice without its secret and the path of its URL, often the only protection."""
        if self.url is None:
            return self
        url = f"{self._parts.scheme}://{self._parts.netloc}{_HIDDEN}"
        return self.model_copy(update={"url": url, "secret": None})

    @property
    def _parts(self) -> SplitResult:
        return urlsplit(self.url or "")


def _is_secret(text: str) -> bool:
    try:
        key = base64.b64decode(text.removeprefix(SECRET_PREFIX), validate=True)
    except ValueError:
        return False
    return text.startswith(SECRET_PREFIX) and len(key) in _SECRET_BYTES
