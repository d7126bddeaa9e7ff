"""What is wrong with a value is told in words that who wrote it knows."""

import re
from collections.abc import Iterator
from typing import Any

import pytest
from pydantic import ValidationError

from plateau.farm.model import input_errors
from plateau.farm.model.renderers import variants
from plateau.farm.model.spec import BatchSpec, JobSpec
from plateau.farm.process.settings import Settings

#: Words of pydantic's and of Python's, which nobody has asked about.
JARGON = re.compile(r"[Ii]nput|literal|tuple|Tuple|valid |pattern|tag |None|\^|should")


def _told(spec: dict[str, Any]) -> dict[str, str]:
    with pytest.raises(ValidationError) as refusal:
        JobSpec.model_validate(spec, strict=True)
    found: dict[str, list[str]] = {}
    for one in refusal.value.errors():
        found.setdefault(str(one["loc"][0]), []).append(input_errors.message(one))
    return {field: input_errors.either(messages) for field, messages in found.items()}


PLACE = "^[A-Za-z0-9][A-Za-z0-9_.-]*$"
VARIANTS = tuple(variants())
RULES = (
    "fixed, successive, multiple, reverse, myszkowski, visible, jod, relmse, rmse, psnr or noise"
)

#: Values that few fields can have.
WRONG: tuple[Any, ...] = (
    *(None, True, -1, 17, 10**400, 1.5, "", "x" * 5000, "\u202e", [], [[]], [None], [-1], [{}]),
    *({}, {"x": 1}, {"name": None}, {"name": ["x"]}, {"url": 1}),
)


@pytest.mark.parametrize(
    ("field", "value", "words"),
    [
        ("step", 0, "must be at least 1"),
        ("step", "100", "must be a whole number"),
        ("step", 1.5, "must be a whole number"),
        ("max_spp", 10**400, "must be at most 1,000,000"),
        ("seed", -1, "must be at least 0"),
        ("time_limit_s", float("nan"), "must be a finite number"),
        ("time_limit_s", [], "must be a number"),
        ("keep_slices", "perhaps", "must be true or false"),
        ("batch", "", "must not be empty"),
        ("batch", "x" * 101, "must have at most 100 characters"),
        ("batch", 1, "must be text"),
        ("variant", "cuda", f"must be auto, {', '.join(VARIANTS[:-1])} or {VARIANTS[-1]}"),
        ("pool", "a b", input_errors.PATTERNS[PLACE]),
        ("requires", ("a",) * 17, "must have at most 16 entries"),
        ("view", {"background": (0.5,)}, "is missing"),
        ("requires", 1, "must be a list, as […] in JSON"),
        ("view", 1, "must be an object, as {…} in JSON"),
        ("view", {"gamma": 2.2}, "there is no such field"),
        ("rule", {}, "must say its name"),
        ("rule", {"name": "guess"}, f"must have the name {RULES}"),
        ("rule", {"name": None}, f"must have the name {RULES}"),
        ("denoise", {"name": "guess"}, "must have the name none or oidn"),
        ("allocation", {"name": "zones", "size": 17}, "must be a multiple of 16"),
        ("parameters", {"width": []}, "must be text, a whole number, a number, or true or false"),
    ],
)
def test_what_is_wrong_is_told_plainly(field: str, value: object, words: str) -> None:
    told = _told({field: value})
    assert told == {field: words}
    assert not JARGON.search(words)


def fields(part: dict[str, Any], schema: dict[str, Any], depth: int = 0) -> Iterator[list[Any]]:
    """The ways to the values of a schema: each field with its object, and 0 in lists."""
    if "$ref" in part:
        part = schema["$defs"][part["$ref"].rpartition("/")[2]]
    yield []
    for one in (*part.get("anyOf", ()), *part.get("oneOf", ())):
        yield from fields(one, schema, depth + 1)
    within: list[tuple[Any, dict[str, Any]]] = [
        ((name, part), one) for name, one in part.get("properties", {}).items()
    ]
    within += [(0, part["items"])] if "items" in part else []
    for begin, one in within if depth < 6 else ():
        for way in fields(one, schema, depth + 1):
            yield [begin, *way]


def placed(value: Any, way: list[Any]) -> Any:
    """The value at the end of this way."""
    for step in reversed(way):
        if step == 0:
            value = [value]
        else:
            name, part = step
            kind = part["properties"].get("name", {}).get("const")
            value = {**({"name": kind} if kind else {}), name: value}
    return value


@pytest.mark.parametrize("kind", [JobSpec, BatchSpec])
def test_nothing_that_is_wrong_anywhere_is_told_in_words_of_pydantic(
    kind: type[JobSpec | BatchSpec],
) -> None:
    schema, told = kind.model_json_schema(), set()
    for way in fields(schema, schema):
        for value in WRONG:
            try:
                kind.model_validate(placed(value, way), strict=True)
            except ValidationError as refusal:
                told |= {input_errors.message(one) for one in refusal.errors()}
    assert len(told) > 30
    assert [words for words in told if JARGON.search(words)] == []


def test_a_setting_that_is_wrong_is_told_without_its_value(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PLATEAU_LEASE_S", "s3cret")
    with pytest.raises(ValidationError) as refusal:
        Settings()
    told = [input_errors.message(one) for one in refusal.value.errors()]
    assert told[0] == "must be a number"
    assert "s3cret" not in "".join(told)
