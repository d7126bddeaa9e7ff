"""What may go wrong with a call to the service.

::

    ClientError
    ├── BadUrl        the URL cannot be that of a service
    ├── BadKey        the API key cannot be one
    ├── Unreachable   nothing answers there
    ├── NotPlateau    something answers there that is not understood
    ├── Damaged       what came of a file is not what the service sent
    ├── ApiError      the service answers with a problem
    └── TimedOut      what was waited for did not come in time; a TimeoutError too
"""

from typing import Any

from plateau.errors import PlateauError


class ClientError(PlateauError):
    """A call to the service did not succeed; the message says what to do."""


class BadUrl(ClientError):
    """The URL cannot be that of a service."""

    def __init__(self, url: str) -> None:
        super().__init__(
            f"{url!r} is not the URL of a service: write it as http://127.0.0.1:8713, "
            "with --url or in PLATEAU_URL"
        )


class BadKey(ClientError):
    """The API key cannot be one; the message does not show it."""

    def __init__(self) -> None:
        super().__init__(
            "the API key has characters that no key has: give it as `plateau keys create` showed "
            "it, in PLATEAU_KEY or PLATEAU_KEY_FILE"
        )


class Unreachable(ClientError):
    """No service answers at the URL."""

    def __init__(self, url: str, why: object) -> None:
        super().__init__(
            f"no Plateau service answers at {url} ({why}); "
            "start one with `plateau up`, or name it by --url or PLATEAU_URL"
        )


class NotPlateau(ClientError):
    """What answers at the URL is no Plateau service, or not of a version that is understood."""

    def __init__(self, url: str, answer: str) -> None:
        super().__init__(
            f"what answers at {url} is no Plateau service of this version ({answer}); "
            "check --url or PLATEAU_URL"
        )


class Damaged(ClientError):
    """What came of a file is not what the service sent."""

    def __init__(self, path: str) -> None:
        super().__init__(
            f"what came of {path} is not what the service sent: its SHA-256 is another; fetch it "
            "again, and look at what lies between this machine and the service where that recurs"
        )


class ApiError(ClientError):
    """The service answered with a problem.

    Attributes
    ----------
    status
        The HTTP status.
    slug
        What kind of problem it is, such as ``unknown-job``; docs/api.md lists them.
    problem
        The whole problem, as RFC 9457 describes it.
    retry_after_s
        How long the service asks to wait before the call is repeated; 0 where it does not.
    """

    def __init__(self, status: int, problem: dict[str, Any], *, retry_after_s: float = 0.0) -> None:
        super().__init__(problem.get("detail") or problem.get("title") or f"HTTP status {status}")
        self.status = status
        self.slug = str(problem.get("type", "")).rpartition("/")[2]
        self.problem = problem
        self.retry_after_s = retry_after_s


class TimedOut(ClientError, TimeoutError):
    """What was waited for did not come in time; the job goes on."""

    def __init__(self, what: str, timeout_s: float) -> None:
        super().__init__(
            f"{what} is not finished after {timeout_s:g} s; it goes on: wait for it again, "
            "or cancel it"
        )
