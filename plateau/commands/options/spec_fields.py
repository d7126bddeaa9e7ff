"""The fields of a spec, from options; a wrong one raises `typer.BadParameter` with its name."""

from pathlib import Path
from typing import Any, Final

import typer

from plateau.commands.options import rule_options


def spec_fields(
    *,
    define: list[str] | None = None,
    rule: str | None = None,
    watch: list[str] | None = None,
    allocation: str | None = None,
    denoise: str | None = None,
    shot: str | None = None,
    exposure: float | None = None,
    white_luminance: float | None = None,
    contrast: float | None = None,
    ambient_lux: float | None = None,
    field_of_view: float | None = None,
    pixels_per_degree: float | None = None,
    seen: str | None = None,
    primaries: str | None = None,
    time_limit: float | None = None,
    require: list[str] | None = None,
    after: list[str] | None = None,
    aov: list[str] | None = None,
    exr_precision: str | None = None,
    exr_compression: str | None = None,
    background: str | None = None,
    focus: Path | None = None,
    **named_alike: object,
) -> dict[str, Any]:
    """The fields of a spec that were given; the options are in `plateau.commands.options`."""
    if field_of_view is not None and (pixels_per_degree is not None or seen is not None):
        raise typer.BadParameter("--field-of-view stands for pixels per degree: give one of them")
    view = view_of_place(seen) | _given(
        exposure_ev=exposure,
        white_luminance=white_luminance,
        contrast=contrast,
        ambient_lux=ambient_lux,
        field_of_view_deg=field_of_view,
        pixels_per_degree=pixels_per_degree,
        primaries=primaries,
        background=background,
        focus=_focus(focus) if focus else None,
    )
    if field_of_view is not None:
        view["pixels_per_degree"] = None  # which a job that is judged again may have
    exr = _given(precision=exr_precision, compression=exr_compression)
    return _given(
        **named_alike,
        time_limit_s=time_limit,
        requires=require or None,
        after=after or None,
        aovs=aov or None,
        exr=exr or None,
        parameters=define or None,
        rule=rule,
        watch=watch or None,
        allocation=allocation,
        denoise=denoise,
        shot=shot,
        view=view or None,
    )


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


def _given(**options: object) -> dict[str, object]:
    return {name: value for name, value in options.items() if value is not None}


def view_of_place(name: str | None) -> dict[str, Any]:
    """The fields of a view that --seen sets; none where it is not given."""
    from plateau.farm.model.spec import PLACES

    if name is None:
        return {}
    if name not in PLACES:
        raise typer.BadParameter(f"--seen takes one of {', '.join(PLACES)}, not {name!r}")
    return dict(PLACES[name])


def _focus(path: Path) -> list[list[float]]:
    from plateau.files.focus_map import focus_of

    return focus_of(path)


#: Options whose names differ from those of the spec's fields.
_OPTIONS: Final = {
    "exposure_ev": "exposure",
    "field_of_view_deg": "field-of-view",
    "time_limit_s": "time-limit",
    "aovs": "aov",
    "requires": "require",
    "fps": "shot",
    "precision": "exr-precision",
    "compression": "exr-compression",
    "parameters": "define",
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
