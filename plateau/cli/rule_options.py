"""The options that stopping rules have: added to a command when it runs, or is explained.

Finding the rules takes some milliseconds, for which no other command waits.
"""

import inspect
from collections.abc import Mapping
from typing import Annotated, Any, Final

import typer

#: The option after which those of the rules stand.
_BEFORE: Final = "watch"


def owners() -> dict[str, str]:
    """The options that are a rule's parameter: by their names, which rule has them."""
    from plateau.rules import as_offered

    found: dict[str, str] = {}
    for rule in as_offered():
        for name, about in rule.parameters().items():
            if about.option:
                found.setdefault(name, rule.name)
    return found


def add(params: list[Any]) -> list[str]:
    """Add the rules' own options to those of a command that has --rule, and name the rules there.

    Returns the names of what was added: an option that the command has itself stays its own.
    """
    taken = {one.name: one for one in params}
    owned = {name: rule for name, rule in owners().items() if name not in taken}
    rule_option = taken["rule"]
    changes = rule_option.show_default if rule_option.show_default == "as it was" else None
    rule_option.help = f"{rule_option.help} {_about(owned)}"
    place = 1 + next(index for index, one in enumerate(params) if one.name == _BEFORE)
    params[place:place] = _made(owned, changes)
    return list(owned)


def fold(given: dict[str, Any], added: list[str]) -> None:
    """Write what was given by the added options into --rule, as a user could have done."""
    values = {name: given.pop(name, None) for name in added}
    said = {name: value for name, value in values.items() if value is not None}
    if said:
        rule = given["rule"] or owners()[next(iter(said))]
        parameters = ",".join(f"{name}={value!r}" for name, value in said.items())
        given["rule"] = f"{rule}{',' if ':' in rule else ':'}{parameters}"


def _about(owned: Mapping[str, str]) -> str:
    from plateau.rules import as_offered

    *names, last = (rule.name for rule in as_offered())
    alone = []
    for rule in dict.fromkeys(owned.values()):
        options = [f"--{name.replace('_', '-')}" for name, owner in owned.items() if owner == rule]
        alone.append(f"{' and '.join(options)} alone mean{'s'[: len(options) == 1]} {rule}")
    return f"There are {', '.join(names)} and {last}. {', '.join(alone)}."


def _made(owned: Mapping[str, str], shown: str | None) -> list[Any]:
    """The options, made as Typer makes those of any function."""
    from plateau.rules import rules

    def options(**_: object) -> None: ...

    parameters = []
    for name, rule in owned.items():
        about = rules()[rule].parameters()[name]
        kind: Any = int if about.is_whole else float
        told = typer.Option(
            help=f"{rule}: {about.description}.", show_default=shown or f"{about.default:g}"
        )
        parameters.append(
            inspect.Parameter(
                name,
                inspect.Parameter.KEYWORD_ONLY,
                default=None,
                annotation=Annotated[kind | None, told],
            )
        )
    options.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    options.__annotations__ = {one.name: one.annotation for one in parameters}
    maker = typer.Typer(add_completion=False)
    maker.command()(options)
    return list(typer.main.get_command(maker).params)
