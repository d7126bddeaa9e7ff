"""Writes what repeats the rules and the problems, for type checkers and readers: ``make manual``.

Tests hold the files to what this makes.
"""

from pathlib import Path

from plateau.extensions import extensions
from plateau.rules import DEFAULT, rules
from plateau.service.api.problems.catalogue import TYPES

ROOT = Path(__file__).parents[1]
STUB = ROOT / "plateau/farm/model/spec/rule_specs.pyi"
DOCS = ROOT / "docs/stopping.md"
API = ROOT / "docs/api.md"


def stub() -> str:
    """Plateau's own rules as type checkers see their specifications."""
    own = {name: rule for name, rule in rules().items() if rule.__module__.startswith("plateau.")}
    lines = [
        "# Written by `make manual` from the rules.",
        "from typing import Annotated, Final, Literal",
        "",
        "from pydantic import Field",
        "",
        "from plateau.farm.model.spec.rule_model import RuleModel",
        "",
        "SPECS: Final[dict[str, type[RuleModel]]]",
        "",
    ]
    for name, rule in own.items():
        lines += [
            f"class {rule.__name__}Spec(RuleModel):",
            f'    name: Literal["{name}"] = "{name}"',
        ]
        for parameter, about in rule.parameters().items():
            kind = "int" if about.is_whole else "float"
            lines.append(f"    {parameter}: {kind} = {about.default!r}")
        lines.append("")
    union = "\n    | ".join(f"{rule.__name__}Spec" for rule in own.values())
    lines += ["RuleSpec = Annotated[", f"    {union},", '    Field(discriminator="name"),', "]", ""]
    return "\n".join(lines)


def table(page: str) -> str:
    """Plateau's own rules as docs/stopping.md lists them; two of its cells are written by hand."""
    lines = [line for line in page.splitlines() if line.startswith("| `")]
    cells = {line.split("`")[1]: line.split(" | ") for line in lines}
    rows = ["| rule | stops when | parameters | stores |", "|---|---|---|---|"]
    for name, rule in rules().items():
        if rule.__module__.startswith("plateau."):
            whose = f"`{name}`, ours, the default" if name == DEFAULT else f"`{name}`"
            parameters = ", ".join(
                f"`{one}` {about.default:g}" for one, about in rule.parameters().items()
            )
            _, criterion, _, stores = cells[name]
            rows.append(f"| {whose} | {criterion} | {parameters} | {stores}")
    return "\n".join(rows) + "\n"


def problems() -> str:
    """All types of problems as docs/api.md lists them."""
    list(extensions("routes"))  # which add types of their own
    rows = ["| type | status | meaning | further members |", "|---|---|---|---|"]
    for kind in TYPES.values():
        members = ", ".join(f"`{name}`" for name in kind.members)
        rows.append(f"| `{kind.uri}` | {kind.status} | {kind.title} | {members} |")
    return "\n".join(rows) + "\n"


def documented(text: str, made: str) -> str:
    """The page with the table that is made as it should be."""
    begin, end = "<!-- `make manual` writes this table -->\n\n", "\n<!-- /table -->"
    before, rest = text.split(begin)
    return f"{before}{begin}{made}{end}{rest.split(end)[1]}"


if __name__ == "__main__":
    STUB.write_text(stub())
    DOCS.write_text(documented(DOCS.read_text(), table(DOCS.read_text())))
    API.write_text(documented(API.read_text(), problems()))
