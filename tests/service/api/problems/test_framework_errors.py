"""What a framework refuses is told in Plateau's words: what happened, and what to do."""

import ast
import inspect

import httpx
import pytest
from starlette import formparsers

from plateau.service.api.problems.framework_errors import in_our_words
from tests.service.api.routes.test_jobs import problem

EDGE = "multipart/form-data; boundary=edge"
NAMED = 'Content-Disposition: form-data; name="{}"'


def form(*parts: str) -> bytes:
    """The body of a form whose parts have these heads."""
    return "".join(f"--edge\r\n{part}\r\n\r\nx\r\n" for part in parts).encode() + b"--edge--\r\n"


def file(name: str) -> str:
    return f'{NAMED.format(name)}; filename="a.xml"'


BROKEN_FORMS = {
    "no boundary": ("multipart/form-data", b"x", "has no boundary"),
    "a long boundary": (f"multipart/form-data; boundary={'x' * 300}", b"x", "cannot be told apart"),
    "no parts": (EDGE, b"x", "cannot be told apart"),
    "a part without a name": (EDGE, form("Content-Disposition: form-data"), "has no name"),
    "three files": (EDGE, form(*map(file, "abc")), "more than 2 files"),
    "nine fields": (EDGE, form(*map(NAMED.format, "abcdefghi")), "more than 8 parts"),
    "a scene that is no file": (
        EDGE,
        form(NAMED.format("scene")).replace(b"x\r\n", b"x" * (1 << 20) + b"x\r\n"),
        "send the scene as a file",
    ),
}


@pytest.mark.parametrize(
    ("media_type", "body", "words"), BROKEN_FORMS.values(), ids=BROKEN_FORMS.keys()
)
def test_a_form_that_cannot_be_read_says_what_to_send(
    http: httpx.Client, media_type: str, body: bytes, words: str
) -> None:
    answer = http.post("/v1/jobs", content=body, headers={"Content-Type": media_type})
    assert words in problem(answer, 400, "malformed-request")["detail"]


@pytest.mark.parametrize("body", [b'{"job_id": 1', b'"\xff"', b"[" * 60_000])
def test_a_body_that_is_not_json_says_what_to_send(http: httpx.Client, body: bytes) -> None:
    answer = http.post("/v1/studies", content=body, headers={"Content-Type": "application/json"})
    found = problem(answer, 400, "malformed-request")
    assert found["detail"].startswith("the body is not JSON")


def test_every_way_in_which_a_form_is_refused_has_words() -> None:
    # Given all that the framework says of forms, in its source
    said = [
        ast.literal_eval(text.values[0] if isinstance(text, ast.JoinedStr) else text)
        for call in ast.walk(ast.parse(inspect.getsource(formparsers)))
        if isinstance(call, ast.Call)
        if isinstance(call.func, ast.Name) and call.func.id == "MultiPartException"
        for text in call.args
    ]
    assert len(said) >= 5
    # Then each has words of its own, and none of it reaches a user
    assert [text for text in said if in_our_words(text) is None] == []
