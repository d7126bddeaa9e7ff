"""The words of a problem stand in the catalogue, and nowhere else."""

import ast
import re
from pathlib import Path
from string import Formatter

import pytest

import plateau
from plateau.service.api.problems import catalogue
from plateau.service.api.problems.problem import Problem, ProblemType

PACKAGE = Path(plateau.__file__).parent
KINDS = {name: one for name, one in vars(catalogue).items() if isinstance(one, ProblemType)}


def calls() -> dict[str, ast.Call]:
    """Every call that makes a problem, or the framework's bare one, by its place."""
    return {
        f"{path.relative_to(PACKAGE)}:{node.lineno}": node
        for path in PACKAGE.rglob("*.py")
        if re.search(r"(Problem|HTTPException)\(", text := path.read_text("utf-8"))
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id in {"Problem", "HTTPException"}
    }


def test_no_site_builds_a_sentence_of_its_own() -> None:
    found = calls()
    assert len(found) > 40
    told = {
        place: ast.unparse(part)
        for place, call in found.items()
        for part in (*call.args, *(one.value for one in call.keywords))
        for node in ast.walk(part)
        if isinstance(node, ast.JoinedStr)
        or (
            isinstance(node, ast.Constant)
            and isinstance(node.value, str)
            and re.search(r"\w \w", node.value)
        )
    }
    assert told == {}


@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)
def test_every_sentence_takes_its_fields(kind: ProblemType) -> None:
    templates = (kind.detail, kind.remedy, kind.at, *kind.headers.values())
    parts = [part for one in templates for part in Formatter().parse(one)]
    asked = {name: 7 if spec else "a {b}" for _, name, spec, _ in parts if name}
    problem = Problem(kind, **asked)
    assert problem.detail
    assert {*problem.members} <= {*kind.members, "errors"}


def test_a_field_that_is_wrong_is_named_in_the_sentence_and_for_programs() -> None:
    problem = Problem(catalogue.INVISIBLE_NAME, field="batch")
    message = "must be a name without invisible characters and line ends"
    assert problem.detail == f"spec.batch: {message}"
    assert problem.members["errors"] == [{"field": "spec.batch", "message": message}]
