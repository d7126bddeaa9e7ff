"""The fields of a spec, from options; a wrong one raises `typer.BadParameter` with its name."""

from typing import Any, Final

import typer

from plateau.commands.options import rule_options

#: By option: the field of a spec, of its view or of its EXR file; "" if the name is the same.
_FIELDS: Final = {
    "define": "parameters",
    "time_limit": "time_limit_s",
    "require": "requires",
    "aov": "aovs",
}
_VIEW: Final = {
    **dict.fromkeys(("white_luminance", "contrast", "ambient_lux", "pixels_per_degree"), ""),
    **dict.fromkeys(("primaries", "background"), ""),
    "exposure": "exposure_ev",
    "field_of_view": "field_of_view_deg",
}
#: By name: the options that --preset stands for.
PRESETS: Final = {"paper": {"rule": "reverse", "allocation": "frame", "seen": "paper"}}
_EXR: Final = {"exr_precision": "precision", "exr_compression": "compression"}


def spec_fields(**options: Any) -> dict[str, Any]:
    """The fields of a spec that were given; `spec_options` has the options."""
    given = {name: value for name, value in options.items() if value not in (None, [])}
    seen = given.pop("seen", None)
    if "field_of_view" in given and (seen is not None or "pixels_per_degree" in given):
        raise typer.BadParameter("--field-of-view stands for pixels per degree: give one of them")
    if (preset := given.pop("preset", None)) is not None:
        if preset not in PRESETS:
            raise typer.BadParameter(f"--preset takes {', '.join(PRESETS)}, not {preset!r}")
        given = {**PRESETS[preset], **given}
        place = given.pop("seen")
        seen = place if seen is None else seen
    view = view_of_place(seen) | _taken(given, _VIEW)
    if options.get("pixels_per_degree") is not None:
        view["field_of_view_deg"] = None  # which a job that is judged again may have, or the place
    exr = _taken(given, _EXR)
    fields = {_FIELDS.get(name, name): value for name, value in given.items()}
    return fields | ({"view": view} if view else {}) | ({"exr": exr} if exr else {})


def _taken(given: dict[str, Any], names: dict[str, str]) -> dict[str, Any]:
    """Take these options out of the given ones; returns their values by their fields."""
    return {names[name] or name: given.pop(name) for name in names.keys() & given.keys()}


def checked(fields: dict[str, Any]) -> Any:
    """The `plateau.farm.model.spec.JobSpec` of these fields, imported here because it is slow.

    Says of wrong fields which options they are.
    """
    from pydantic import ValidationError

    from plateau.farm.model import input_errors
    from plateau.farm.model.spec import JobSpec

    try:
        return JobSpec.model_validate(fields)
    except ValidationError as error:
        messages = [
            _message(one["loc"], one["type"], input_errors.message(one)) for one in error.errors()
        ]
        raise typer.BadParameter("; ".join(messages)) from error


def view_of_place(name: str | None) -> dict[str, Any]:
    """The fields of a view that --seen sets; none where it is not given."""
    from plateau.farm.model.spec import PLACES

    if name is None:
        return {}
    if name not in PLACES:
        raise typer.BadParameter(f"--seen takes one of {', '.join(PLACES)}, not {name!r}")
    return {"field_of_view_deg": None, **PLACES[name]}


_OPTIONS: Final = {
    "fps": "shot",
    **{field: option for option, field in (_FIELDS | _VIEW | _EXR).items() if field},
}


def _message(location: tuple[int | str, ...], kind: str, message: str) -> str:
    """The error of a field, as the error of its option."""
    from plateau.farm.model import input_errors

    if not location:
        return message
    if kind == "union_tag_invalid":
        return f"--{location[0]}: {message.replace(input_errors.UNKNOWN_NAME, 'must be', 1)}"
    name = next(str(one) for one in reversed(location) if isinstance(one, str))
    option = f"--{_OPTIONS.get(name, name).replace('_', '-')}"
    named = next((str(one) for one in location[1:-1] if isinstance(one, str)), "")
    is_rule = location[0] in {"rule", "watch"} and name not in rule_options.owners()
    if named and (is_rule or location[0] in {"allocation", "denoise"}):
        what = "there is no such parameter" if kind == "extra_forbidden" else message
        return f"--{location[0]} {named}:{name}: {what}"
    if kind == "extra_forbidden":
        return f"{option} is not an option of the rule {named}"
    return f"{option}: {message}"
