"""The fields of a spec, from options; a wrong one raises `typer.BadParameter` with its name."""

from contextlib import suppress
from pathlib import Path
from typing import Any, Final

import typer

from plateau.cli import rule_options


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
    """The fields of a spec that were given; the options are in `plateau.cli.options`."""
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
        background=None if background is None else _colour(background),
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
        parameters=dict(map(_definition, define)) if define else None,
        rule=None if rule is None else _named(rule, "a rule"),
        watch=[_named(one, "a rule") for one in watch] if watch else None,
        allocation=None if allocation is None else _named(allocation, "an allocation"),
        denoise=None if denoise is None else _named(denoise, "a denoiser"),
        shot=None if shot is None else _shot(shot),
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


def _definition(text: str) -> tuple[str, str]:
    name, separator, value = text.partition("=")
    if not (separator and name):
        raise typer.BadParameter(f"-D takes NAME=VALUE, not {text!r}")
    return name, value


def _colour(text: str) -> list[float]:
    try:
        red, green, blue = map(float, text.split(","))
    except ValueError:
        raise typer.BadParameter(f"--background takes R,G,B, not {text!r}") from None
    return [red, green, blue]


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


def _named(text: str, what: str) -> dict[str, str | int | float]:
    """A rule, an allocation or a denoiser from its text: ``name`` or ``name:parameter=value,…``."""
    name, _, parameters = text.partition(":")
    given: dict[str, str | int | float] = {"name": name}
    for definition in filter(None, parameters.split(",")):
        parameter, separator, value = definition.partition("=")
        if not (separator and parameter):
            raise typer.BadParameter(f"{what} is NAME or NAME:PARAMETER=VALUE,…, not {text!r}")
        given[parameter] = _number(value)
    return given


def _shot(text: str) -> dict[str, Any]:
    """A shot from its text: ``FPS``, ``FPS:target=JOD`` or ``FPS:target=none``."""
    fps, _, target = text.partition(":")
    given: dict[str, Any] = {"fps": _number(fps)}
    if target:
        name, _, jod = target.partition("=")
        if name != "target" or not jod:
            raise typer.BadParameter(f"--shot takes FPS, or FPS:target=JOD, not {text!r}")
        given["target"] = None if jod == "none" else _number(jod)
    return given


def _number(text: str) -> str | int | float:
    """The number that the text stands for; any other text as it is."""
    for kind in (int, float):
        with suppress(ValueError):
            return kind(text)
    return text


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
    is_rule = location[0] in {"rule", "watch"}
    if location[0] in {"allocation", "denoise"} or (is_rule and name not in rule_options.owners()):
        what = "there is no such parameter" if kind == "extra_forbidden" else message
        return f"--{location[0]} {named}:{name}: {what}"
    if kind == "extra_forbidden":
        return f"{option} is not an option of the rule {named}"
    return f"{option}: {message}"
