"""Options that a function describes, given to commands."""

import inspect
from collections.abc import Callable, Collection
from functools import wraps
from typing import Any, TypeAlias

Decorator: TypeAlias = Callable[[Callable[..., None]], Callable[..., None]]


def options_of(of: Callable[..., Any], *, but: Collection[str] = ()) -> list[inspect.Parameter]:
    """The parameters of a function as options, except these."""
    return [one for name, one in inspect.signature(of).parameters.items() if name not in but]


def taking(
    parameter: str, made_by: Callable[..., Any], options: list[inspect.Parameter]
) -> Decorator:
    """Give a command these options in place of a parameter, which `made_by` makes of them."""

    def decorated(command: Callable[..., None]) -> Callable[..., None]:
        own = inspect.signature(command).parameters

        @wraps(command)
        def with_options(**given: Any) -> None:
            made = made_by(**{option.name: given.pop(option.name) for option in options})
            command(**{parameter: made}, **given)

        taken = [one.replace(kind=one.KEYWORD_ONLY) for one in own.values()]
        taken = [one for one in taken if one.name != parameter] + options
        with_options.__signature__ = inspect.Signature(taken)  # type: ignore[attr-defined]
        with_options.__annotations__ = {one.name: one.annotation for one in taken}
        return with_options

    return decorated
