"""Options that several commands share."""

import inspect
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Annotated, Any, Final, TypeAlias

import typer

import scenes


def _scene(given: Path) -> Path:
    """Return the path of a scene, which may be one of ours by its name, as `scenes:box`."""
    scheme, separator, name = str(given).partition(":")
    if scheme != "scenes" or not separator:
        return given
    if name not in scenes.NAMES:
        known = ", ".join(f"scenes:{one}" for one in scenes.NAMES)
        raise typer.BadParameter(f"there is no scenes:{name}; there are {known}")
    return scenes.FOLDER / name


Scene = Annotated[
    Path,
    typer.Argument(
        callback=_scene,
        help=f"A Mitsuba XML, a zip of one, a folder with scene.xml, or one of Plateau's own: "
        f"scenes:NAME, where NAME is {', '.join(scenes.NAMES)}.",
    ),
]
JobId = Annotated[str, typer.Argument(help="The job's id.", metavar="ID")]
Url = Annotated[
    str | None,
    typer.Option(
        "--url",
        envvar="PLATEAU_URL",
        help="Where the service is.",
        show_default="http://127.0.0.1:8713",
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print JSON, for scripts.")]

#: A `farm.spec.JobSpec`, by `takes_spec`; its module is imported only where a command runs.
Spec: TypeAlias = Any


def spec_from_options(
    *,
    define: Annotated[
        list[str] | None,
        typer.Option(
            "--define", "-D", metavar="NAME=VALUE", help="Value of the scene's $NAME; repeatable."
        ),
    ] = None,
    step: Annotated[
        int | None, typer.Option(help="Spp between two evaluations.", show_default="100")
    ] = None,
    slice_spp: Annotated[
        int | None, typer.Option(help="Spp of one slice of work.", show_default="25")
    ] = None,
    max_spp: Annotated[
        int | None, typer.Option(help="Cap, where it is exhausted.", show_default="10000")
    ] = None,
    time_limit: Annotated[
        float | None, typer.Option(help="Seconds after which it is exhausted.", show_default="none")
    ] = None,
    rule: Annotated[
        str | None,
        typer.Option(
            help="What ends it: visible, reverse, fixed, successive, multiple or myszkowski, with "
            "its parameters as in visible:target=0.001,min_spp=300. --window and --epsilon alone "
            "mean reverse, --spp alone means fixed.",
            show_default="visible",
        ),
    ] = None,
    watch: Annotated[
        list[str] | None,
        typer.Option(help="A rule to report beside it, written the same way; repeatable."),
    ] = None,
    window: Annotated[
        int | None, typer.Option(help="reverse: points in the regression.", show_default="5")
    ] = None,
    epsilon: Annotated[
        float | None,
        typer.Option(
            help="reverse: slope at which to stop, in visible pixels per spp at 512×512.",
            show_default="0.1",
        ),
    ] = None,
    spp: Annotated[
        int | None, typer.Option(help="fixed: spp at which to stop.", show_default="10000")
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(help="Another seed draws independent samples.", show_default="0"),
    ] = None,
    variant: Annotated[
        str | None,
        typer.Option(
            help="auto, scalar_rgb, llvm_ad_rgb or cuda_ad_rgb.",
            show_default="auto",
        ),
    ] = None,
    sensor: Annotated[
        int | None, typer.Option(help="Index of the scene's sensor.", show_default="0")
    ] = None,
    exposure: Annotated[
        float | None, typer.Option(help="Exposure in EV.", show_default="0")
    ] = None,
    white_luminance: Annotated[
        float | None, typer.Option(help="The display's white in cd/m².", show_default="100")
    ] = None,
    field_of_view: Annotated[
        float | None,
        typer.Option(help="Angle that the image's width fills, in degrees.", show_default="45"),
    ] = None,
    primaries: Annotated[
        str | None,
        typer.Option(help="The display's: rec709 or adobe1998.", show_default="rec709"),
    ] = None,
    priority: Annotated[
        int | None, typer.Option(help="Higher is served first.", show_default="0")
    ] = None,
    batch: Annotated[str | None, typer.Option(help="A name that groups jobs.")] = None,
    keep_slices: Annotated[
        bool, typer.Option("--keep-slices", help="Keep every slice, for `plateau judge`.")
    ] = False,
) -> Spec:
    """The spec that the options ask for; what was left out has the spec's own default.

    Raises
    ------
    typer.BadParameter
        A value is not allowed; the message names the option.
    """
    from pydantic import ValidationError

    from farm.spec import JobSpec

    given: dict[str, Any] = _given(
        step=step,
        slice_spp=slice_spp,
        max_spp=max_spp,
        time_limit_s=time_limit,
        seed=seed,
        variant=variant,
        sensor=sensor,
        priority=priority,
        batch=batch,
        keep_slices=keep_slices,
    )
    given["parameters"] = dict(map(_definition, define or ()))
    given["rule"] = {
        **_rule(rule or _rule_of(window, epsilon, spp)),
        **_given(window=window, epsilon=epsilon, spp=spp),
    }
    given["watch"] = list(map(_rule, watch or ()))
    given["view"] = _given(
        exposure_ev=exposure,
        white_luminance=white_luminance,
        field_of_view_deg=field_of_view,
        primaries=primaries,
    )
    try:
        return JobSpec.model_validate(given)
    except ValidationError as error:
        messages = [_message(one["loc"], one["type"], one["msg"]) for one in error.errors()]
        raise typer.BadParameter("; ".join(messages)) from error


def takes_spec(command: Callable[..., None]) -> Callable[..., None]:
    """Give the command the options of a spec in place of its parameter `spec`."""
    own = inspect.signature(command).parameters
    options = inspect.signature(spec_from_options).parameters

    @wraps(command)
    def with_options(**given: Any) -> None:
        spec = spec_from_options(**{name: given.pop(name) for name in options})
        command(spec=spec, **given)

    parameters = [one.replace(kind=one.KEYWORD_ONLY) for one in own.values() if one.name != "spec"]
    parameters += options.values()
    with_options.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    with_options.__annotations__ = {one.name: one.annotation for one in parameters}
    return with_options


def _given(**options: object) -> dict[str, object]:
    return {name: value for name, value in options.items() if value is not None}


def _definition(text: str) -> tuple[str, str]:
    name, separator, value = text.partition("=")
    if not (separator and name):
        raise typer.BadParameter(f"-D takes NAME=VALUE, not {text!r}")
    return name, value


def _rule(text: str) -> dict[str, str]:
    """A rule as it is written on the command line: ``name`` or ``name:parameter=value,…``."""
    name, _, parameters = text.partition(":")
    given = {"name": name}
    for definition in filter(None, parameters.split(",")):
        parameter, separator, value = definition.partition("=")
        if not (separator and parameter):
            raise typer.BadParameter(f"a rule is NAME or NAME:PARAMETER=VALUE,…, not {text!r}")
        given[parameter] = value
    return given


def _rule_of(window: int | None, epsilon: float | None, spp: int | None) -> str:
    """The rule that options mean which only it has."""
    if window is not None or epsilon is not None:
        return "reverse"
    return "visible" if spp is None else "fixed"


#: Where an option is not called as the spec's field.
_OPTIONS: Final = {
    "exposure_ev": "exposure",
    "field_of_view_deg": "field-of-view",
    "time_limit_s": "time-limit",
    "name": "rule",
}


def _message(location: tuple[int | str, ...], kind: str, message: str) -> str:
    message = message.removeprefix("Value error, ")
    if not location:
        return message
    if kind == "union_tag_invalid":
        return f"--rule: {message}"
    name = str(location[-1])
    option = f"--{_OPTIONS.get(name, name).replace('_', '-')}"
    if kind == "extra_forbidden":
        return f"{option} is not an option of the rule {location[1]}"
    return f"{option}: {message}"
