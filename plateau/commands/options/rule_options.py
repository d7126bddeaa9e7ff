"""The options of stopping rules, added to a command when it runs or prints its help.

To find rules and renderers takes some milliseconds, which other commands should not lose.
"""

import inspect
from collections.abc import Mapping
from typing import Annotated, Any

import typer


def owners() -> dict[str, str]:
    """By the name of each option that is a rule's parameter: the rule."""
    from plateau.rules import as_offered

    found: dict[str, str] = {}
    for rule in as_offered():
        for name, about in rule.parameters().items():
            if about.option:
                found.setdefault(name, rule.name)
    return found


def add(params: list[Any]) -> list[str]:
    """Add the rules' options to those of a command after --watch; name the rules in --rule's help.

    The help of --variant names the renderers' variants.

    Returns the names of the added options; an option of the command itself is not replaced.
    """
    from plateau.farm.model.renderers import renderers

    taken = {one.name: one for one in params}
    owned = {name: rule for name, rule in owners().items() if name not in taken}
    rule_option = taken["rule"]
    changes = rule_option.show_default if rule_option.show_default == "as it was" else None
    rule_option.help = f"{rule_option.help} {_about(owned)}"
    if "variant" in taken:
        known = "; ".join(one.help for one in renderers().values())
        taken["variant"].help = f"{taken['variant'].help} {known}."
    place = 1 + next(index for index, one in enumerate(params) if one.name == "watch")
    params[place:place] = _made(owned, changes)
    return list(owned)


def fold(given: dict[str, Any], added: list[str]) -> None:
    """Write the values of the added options into --rule, as a user could have written them."""
    values = {name: given.pop(name, None) for name in added}
    set_values = {name: value for name, value in values.items() if value is not None}
    if set_values:
        rule = given["rule"] or owners()[next(iter(set_values))]
        parameters = ",".join(f"{name}={value!r}" for name, value in set_values.items())
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
    """The options, as Typer makes them of a function's parameters."""
    from plateau.rules import rules

    def options(**_: object) -> None: ...

    parameters = []
    for name, rule in owned.items():
        about = rules()[rule].parameters()[name]
        kind: Any = int if about.is_whole else float
        option = typer.Option(
            help=f"{rule}: {about.description}.", show_default=shown or f"{about.default:g}"
        )
        parameters.append(
            inspect.Parameter(
                name,
                inspect.Parameter.KEYWORD_ONLY,
                default=None,
                annotation=Annotated[kind | None, option],
            )
        )
    options.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    options.__annotations__ = {one.name: one.annotation for one in parameters}
    maker = typer.Typer(add_completion=False)
    maker.command()(options)
    return list(typer.main.get_command(maker).params)
