"""The API's description of itself: complete, and each of its examples works."""

import json
import re
from collections.abc import Iterator
from typing import Any

import httpx
import jsonschema_rs
import pytest
import redis
from openapi_spec_validator import OpenAPIV31SpecValidator, validate

from plateau.extensions import extensions
from plateau.farm.model import input_errors
from plateau.farm.wire import examples
from plateau.service.api.access.key_guard import needs_key
from plateau.service.api.problems.catalogue import TYPES
from plateau.service.api.submission import idempotency
from tests.support.api_calls import submit
from tests.support.farms.staged_job import StagedJob

JSON = "application/json"
PROBLEM = "application/problem+json"

Operation = tuple[str, str, dict[str, Any]]


@pytest.fixture(scope="session")
def document(session_api: str) -> dict[str, Any]:
    return httpx.get(f"{session_api}/openapi.json", trust_env=False, timeout=60).json()


@pytest.fixture(scope="session")
def operations(document: dict[str, Any]) -> list[Operation]:
    """The method, the path and the description of each call."""
    return [
        (method.upper(), path, described)
        for path, item in document["paths"].items()
        for method, described in item.items()
    ]


#: By their schemas: to make one takes long.
_VALIDATORS: dict[str, jsonschema_rs.Draft202012Validator] = {}


def violations(document: dict[str, Any], schema: dict[str, Any], example: object) -> list[str]:
    """Where the example breaks its schema, which may refer to others of the document."""
    key = json.dumps(schema)
    if key not in _VALIDATORS:
        whole = {"components": document["components"], **schema}
        _VALIDATORS[key] = jsonschema_rs.Draft202012Validator(whole, validate_formats=True)
    return [error.message for error in _VALIDATORS[key].iter_errors(example)]


def shown(media: dict[str, Any]) -> Iterator[object]:
    """The examples of a body that stand beside its schema."""
    if "example" in media:
        yield media["example"]
    yield from (one["value"] for one in media.get("examples", {}).values())


def patterns(document: object) -> set[str]:
    """Every pattern that a part of the document asks for."""
    if isinstance(document, list):
        return set().union(*map(patterns, document))
    if not isinstance(document, dict):
        return set()
    own = document.get("pattern")
    within = set().union(*map(patterns, document.values()))
    return {*within, own} if isinstance(own, str) else within


def test_a_pattern_is_told_in_words(http: httpx.Client, document: dict[str, Any]) -> None:
    # Given all patterns of the document but those that the API checks in words of its own
    own = {"^https?://", idempotency.PARAMETERS[0]["schema"]["pattern"]}
    asked = patterns(document["paths"]) | patterns(document["components"])
    assert asked - own == input_errors.PATTERNS.keys()
    # When an id is none, then it is told what an id is
    answer = http.get("/v1/jobs", params={"owner": "nope"}).json()
    assert answer["detail"] == f"owner: {input_errors.PATTERNS['^[0-9a-f]{12}$']}"


def test_the_document_is_valid_openapi_3_1(document: dict[str, Any]) -> None:
    assert document["openapi"].startswith("3.1.")
    validate(document, cls=OpenAPIV31SpecValidator)


def test_every_operation_has_a_name_of_its_own(
    document: dict[str, Any], operations: list[Operation]
) -> None:
    told = [
        described["operationId"]
        for item in document["webhooks"].values()
        for described in item.values()
    ]
    names = [described["operationId"] for _, _, described in operations] + told
    assert {"submit_job", "get_job", "list_jobs", "get_image_exr", "tell_of_job"} <= set(names)
    assert len(set(names)) == len(names)
    # A verb and what it is done to, as `submit_job`, and nothing of the path
    assert [name for name in names if not re.fullmatch(r"[a-z]+(_[a-z]+)+", name)] == []
    assert [name for name in names if "v1" in name] == []


def test_every_body_says_all_that_may_be_in_it(
    document: dict[str, Any], operations: list[Operation]
) -> None:
    for method, path, described in operations:
        for media in described.get("requestBody", {}).get("content", {}).values():
            schema = resolved(document, media["schema"])
            assert schema["additionalProperties"] is False, f"{method} {path}"


def test_every_call_and_all_that_it_takes_is_described(operations: list[Operation]) -> None:
    assert len(operations) > 20
    for method, path, described in operations:
        assert described["description"], f"{method} {path}"
        for parameter in described.get("parameters", ()):
            name = f"{method} {path}: {parameter['name']}"
            assert parameter["description"], name
            assert "example" in parameter or examples_of(parameter), name


def examples_of(parameter: dict[str, Any]) -> list[object]:
    return list(parameter.get("examples", ())) or list(parameter["schema"].get("examples", ()))


def test_every_header_that_is_read_is_there(operations: list[Operation]) -> None:
    for method, path, described in operations:
        headers = {
            parameter["name"].lower()
            for parameter in described.get("parameters", ())
            if parameter["in"] == "header"
        }
        expected = {"if-none-match"} if "304" in described["responses"] else set()
        if (method, path.rpartition("/")[2]) in {("POST", "jobs"), ("POST", "again")}:
            expected = {"idempotency-key"}
        elif path.endswith("/events"):
            expected = {"last-event-id"}
        assert headers == expected, f"{method} {path}"


def test_every_answer_of_text_has_an_example_that_is_valid(
    document: dict[str, Any], operations: list[Operation]
) -> None:
    for method, path, described in operations:
        for status, answer in described["responses"].items():
            for media_type, media in answer.get("content", {}).items():
                name = f"{method} {path}: {status} {media_type}"
                if media["schema"].get("format") == "binary":
                    continue
                found = [*shown(media), *of_its_schema(document, media["schema"])]
                assert found, name
                for example in found:
                    assert violations(document, media["schema"], example) == [], name


def resolved(document: dict[str, Any], schema: dict[str, Any]) -> dict[str, Any]:
    reference = schema.get("$ref")
    if reference is None:
        return schema
    return document["components"]["schemas"][reference.rpartition("/")[2]]


def of_its_schema(document: dict[str, Any], schema: dict[str, Any]) -> list[object]:
    return list(resolved(document, schema).get("examples", ()))


def numbers(document: dict[str, Any], part: Any, name: str, seen: set[str]) -> Iterator[Any]:
    """Each number in a schema and those that it refers to, with the name of its field."""
    if isinstance(part, list):
        for one in part:
            yield from numbers(document, one, name, seen)
    elif isinstance(part, dict):
        reference = part.get("$ref", "")
        if reference and reference not in seen:
            seen.add(reference)
            kind = reference.rpartition("/")[2]
            yield from numbers(document, document["components"]["schemas"][kind], kind, seen)
        if part.get("type") in {"integer", "number"}:
            yield name, part
        for key in ("anyOf", "oneOf", "allOf", "items", "prefixItems", "additionalProperties"):
            yield from numbers(document, part.get(key), name, seen)
        for field, one in part.get("properties", {}).items():
            yield from numbers(document, one, f"{name}.{field}", seen)


def test_every_number_that_it_takes_has_bounds(
    document: dict[str, Any], operations: list[Operation]
) -> None:
    """What has none fails late: as a number that no clock, no film and no Redis can hold.

    Paths are left out, for they name something that is there or is not.
    """
    found: list[tuple[str, dict[str, Any]]] = []
    for _, path, operation in operations:
        for one in operation.get("parameters", []):
            if one["in"] != "path":
                found += numbers(document, one["schema"], one["name"], set())
        for body in operation.get("requestBody", {}).get("content", {}).values():
            found += numbers(document, body["schema"], path, set())
    names = {name for name, _ in found}
    assert {"limit", "JobSpec.step", "ViewSpec.exposure_ev", "Screen.pixel_pitch_mm"} <= names
    # Of a scene's parameters only the scene knows what they may be.
    scenes = {"JobSpec.parameters", "BatchSpec.parameters"}
    unbounded = {name for name, part in found if not {"minimum", "maximum"} <= part.keys()}
    assert unbounded == scenes


def test_every_error_is_a_problem_of_a_known_type(operations: list[Operation]) -> None:
    for method, path, described in operations:
        statuses = set(described["responses"])
        refusals = {"401", "403"} if needs_key(path) else set()
        assert {*refusals, "500"} < statuses, path
        assert "default" not in statuses
        for status, answer in described["responses"].items():
            if status < "400":
                continue
            name = f"{method} {path}: {status}"
            assert set(answer["content"]) == {PROBLEM}, name
            for slug, example in answer["content"][PROBLEM]["examples"].items():
                assert TYPES[slug].status == int(status) == example["value"]["status"], name
                assert f"`/problems/{slug}`" in answer["description"], name


class TestTheRequestExamples:
    def test_are_valid(self, document: dict[str, Any], operations: list[Operation]) -> None:
        for method, path, described in operations:
            for media in described.get("requestBody", {}).get("content", {}).values():
                found = [*shown(media), *of_its_schema(document, media["schema"])]
                assert found, f"{method} {path}"
                for example in found:
                    assert violations(document, media["schema"], example) == []
            for parameter in described.get("parameters", ()):
                single = [parameter["example"]] if "example" in parameter else []
                for example in [*single, *examples_of(parameter)]:
                    schema = parameter["schema"]
                    assert violations(document, schema, example) == [], parameter["name"]

    def test_make_jobs(self, http: httpx.Client, document: dict[str, Any]) -> None:
        content = document["paths"]["/v1/jobs"]["post"]["requestBody"]["content"]
        bodies = content["multipart/form-data"]["examples"]
        upload, stored = bodies["an upload"]["value"], bodies["a stored scene"]["value"]
        key = {"Idempotency-Key": examples.IDEMPOTENCY_KEY}
        first = submit(http, upload["scene"].encode(), upload["spec"], headers=key)
        assert first.status_code == 201, first.text
        assert first.json()["spec"]["max_spp"] == upload["spec"]["max_spp"]
        # The second names the scene that the first has brought
        again = submit(http, None, stored["spec"], scene_sha256=stored["scene_sha256"])
        assert again.status_code == 201, again.text
        assert again.json()["scene_sha256"] == first.json()["scene_sha256"]

    def test_are_understood_where_they_are_parameters(
        self, http: httpx.Client, client: redis.Redis, operations: list[Operation]
    ) -> None:
        job = StagedJob(client, batch="exposures", shot={"fps": 24})
        theirs = {route.path for one in extensions("routes") for route in one.router.routes}
        for method, path, described in operations:
            if method == "GET" and path not in theirs:
                check_parameters_are_understood(http, path, described, job_id=job.id)


def check_parameters_are_understood(
    http: httpx.Client, path: str, described: dict[str, Any], **ids: str
) -> None:
    """Ask with the parameters' examples, and these ids in the path."""
    given: dict[str, dict[str, Any]] = {"path": {}, "query": {}, "header": {}}
    for parameter in described.get("parameters", ()):
        given[parameter["in"]][parameter["name"]] = examples_of(parameter)[0]
    if "job" in given["query"]:
        given["query"]["job"] = [ids["job_id"]]
    answer = http.get(
        path.format(**{**given["path"], **ids}),
        params=given["query"],
        headers={**given["header"], "Accept": f"{JSON}, */*;q=0.1"},
    )
    # What was staged has no images
    expected = 404 if path.endswith((".png", ".exr")) else 200
    assert answer.status_code == expected, f"{path}: {answer.text}"
