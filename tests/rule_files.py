"""Writes what repeats the rules, for type checkers and readers: ``make manual``.

A test holds both files to what this makes.
"""

from pathlib import Path

from plateau.rules import DEFAULT, rules

ROOT = Path(__file__).parents[1]
STUB = ROOT / "plateau/farm/model/spec/rule_specs.pyi"
DOCS = ROOT / "docs/stopping.md"
BEGIN, END = "<!-- installed rules -->\n\n", "\n<!-- /installed rules -->"


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


def table() -> str:
    """Plateau's own rules as docs/stopping.md lists them."""
    rows = ["| rule | stops when | parameters | stores |", "|---|---|---|---|"]
    for name, rule in rules().items():
        if rule.__module__.startswith("plateau."):
            whose = f"`{name}`, ours, the default" if name == DEFAULT else f"`{name}`"
            parameters = ", ".join(
                f"`{one}` {about.default:g}" for one, about in rule.parameters().items()
            )
            rows.append(f"| {whose} | {rule.criterion} | {parameters} | {rule.stores} |")
    return "\n".join(rows) + "\n"


def documented(text: str) -> str:
    """The page with its table of the rules as it should be."""
    before, rest = text.split(BEGIN)
    return f"{before}{BEGIN}{table()}{END}{rest.split(END)[1]}"


if __name__ == "__main__":
    STUB.write_text(stub())
    DOCS.write_text(documented(DOCS.read_text()))
