"""Problems by RFC 9457: every error of the API has a stable type and says what to do."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final

from fastapi.responses import JSONResponse
from pydantic import BaseModel, ConfigDict, Field
from starlette.exceptions import HTTPException

MEDIA_TYPE: Final = "application/problem+json"


@dataclass(frozen=True)
class ProblemType:
    """A kind of problem, with the sentences that tell a person of it.

    `detail`, `remedy`, `at` and the values of `headers` are templates of `str.format`, filled with
    the fields that whoever raises the problem passes.
    """

    slug: str  #: the last part of its `type`
    status: int
    title: str
    detail: str  #: what happened
    remedy: str = ""  #: what to do
    at: str = ""  #: the field of the request that is wrong, where it is one
    members: tuple[str, ...] = ()  #: the fields that the answer has too, for programs
    headers: Mapping[str, str] = field(default_factory=dict)
    example: Mapping[str, object] = field(default_factory=dict)  #: the fields of an example

    @property
    def uri(self) -> str:
        """The problem's ``type``, a path at which the API explains it."""
        return f"/problems/{self.slug}"

    def case(self, detail: str, remedy: str | None = None, **changes: Any) -> "ProblemType":
        """The same type with other words; without a remedy, with the same one."""
        said = self.remedy if remedy is None else remedy
        return replace(self, detail=detail, remedy=said, **changes)

    def of(self, at: str, message: str) -> "ProblemType":
        """The same type, of a field of the request: `message` follows the field's name."""
        return replace(self, detail=message, at=at)

    def words(self, fields: Mapping[str, object]) -> str:
        """What a person is told."""
        said = "; ".join(filter(None, (self.detail, self.remedy))).format_map(fields)
        return f"{self.at.format_map(fields)}: {said}" if self.at else said


class FieldError(BaseModel):
    """One field that was refused."""

    field: str = Field(description="the field's name, with dots where it is nested")
    message: str


class ProblemDetails(BaseModel):
    """A problem by RFC 9457; some types carry more members."""

    model_config = ConfigDict(extra="allow")

    type: str = Field(description="what kind of problem it is: stable, for programs")
    title: str = Field(description="the kind in words")
    status: int
    detail: str = Field(description="what happened, and what to do about it")
    instance: str = Field(description="the path that was asked for")


class Problem(HTTPException):
    """Raised by a route to answer with a problem of the catalogue; `fields` fill its sentences."""

    def __init__(
        self, kind: ProblemType, headers: Mapping[str, str] | None = None, /, **fields: object
    ) -> None:
        sent = {name: value.format_map(fields) for name, value in kind.headers.items()}
        super().__init__(kind.status, kind.words(fields), {**sent, **(headers or {})} or None)
        self.kind = kind
        self.members = {name: fields[name] for name in kind.members if name in fields}
        if kind.at:
            message = replace(kind, at="").words(fields)
            self.members["errors"] = [{"field": kind.at.format_map(fields), "message": message}]

    def body(self, path: str) -> dict[str, Any]:
        """The JSON of the answer to a request for `path`."""
        return {
            "type": self.kind.uri,
            "title": self.kind.title,
            "status": self.kind.status,
            "detail": self.detail,
            "instance": path,
            **self.members,
        }

    def response(self, path: str) -> JSONResponse:
        """The response to a request for `path`."""
        return JSONResponse(self.body(path), self.kind.status, self.headers, MEDIA_TYPE)
