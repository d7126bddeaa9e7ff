"""The errors of a blob store in one line for people: obstore's words, the server's, a remedy."""

import re
from typing import Final

_REQUEST: Final = re.compile(r"Error performing ([A-Z]+) (\S+) in ")
_STATUS: Final = re.compile(r"status code: (\d{3}[ \w]*?): ?(.*)")
_CODE: Final = re.compile(r"<Code>(\w+)</Code>")
#: The system's message, deep in obstore's chain of causes.
_CAUSE: Final = re.compile(r'(?:message|error): "([^"]+)"')

_SILENCE: Final = "TimedOut"
_KEYS: Final = "AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY"
_NO_USER: Final = "the store does not know this AWS_ACCESS_KEY_ID"
_MAY_NOT: Final = "the store does not allow that with these credentials"
#: What to do, by a text in the error.
_REMEDIES: Final = {
    "<Code>NoSuchBucket<": "there is no such bucket: make it, or set PLATEAU_BLOBS to another",
    "<Code>InvalidAccessKeyId<": _NO_USER,
    "<Code>XAdminUserNotFound<": _NO_USER,  # versitygw, as 404
    "<Code>SignatureDoesNotMatch<": "AWS_SECRET_ACCESS_KEY is not that of AWS_ACCESS_KEY_ID",
    "<Code>ExpiredToken<": "AWS_SESSION_TOKEN has expired",
    "<Code>InvalidToken<": "AWS_SESSION_TOKEN does not belong to these credentials",
    "<Code>RequestTimeTooSkewed<": "this machine's clock differs from the store's",
    "<Code>AccessDenied<": _MAY_NOT,
    "code: AccessDenied": _MAY_NOT,  # for one blob of a bulk delete
    "169.254.169.254": f"there are no credentials: set {_KEYS}",
    "UnknownIssuer": "this machine does not trust its certificate: set AWS_CA_BUNDLE",
    "InvalidContentType": "it does not speak TLS: is its endpoint an http:// one?",
    "BareRedirect": "the bucket is in another region: set AWS_REGION",
    _SILENCE: "it does not answer",
    "IncompleteMessage": "it closed the connection",
}


def why(error: Exception) -> str:
    """An error of a store in one line, with the remedy where one is known."""
    text = str(error)
    said = _said(text)
    for sign, remedy in _REMEDIES.items():
        if sign in text:
            return f"{remedy} ({said})"
    return said


def is_silence(error: Exception) -> bool:
    """Whether a store did not answer in time."""
    return _SILENCE in str(error)


def is_absence(error: FileNotFoundError) -> bool:
    """Whether the blob is missing, not the bucket or the user.

    A server answers 404 for all three; so may a gateway without a server behind it.
    """
    answer = _STATUS.search(str(error))
    return answer is None or not answer[2] or "<Code>NoSuchKey<" in str(error)


def _said(text: str) -> str:
    first = text.partition("\n")[0]  # the chain of causes follows
    request = _REQUEST.search(first)
    if request is None:
        return first
    answer, code, cause = _STATUS.search(text), _CODE.search(text), _CAUSE.search(text)
    if answer is not None:
        words = f"{answer[1]}, {code[1]}" if code is not None else answer[1]
    else:
        words = cause[1] if cause is not None else first.rpartition(" - ")[2]
    return f"{request[1]} {request[2]}: {words}"
