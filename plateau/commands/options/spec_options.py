"""The options that make a spec, for commands that take one."""

import inspect
from collections.abc import Collection
from copy import copy
from typing import Annotated, Any, Final, TypeAlias, get_args

import typer

from plateau.commands.options import FieldOfView, PixelsPerDegree, Seen, WhiteLuminance, complete
from plateau.commands.options.spec_fields import checked, spec_fields
from plateau.commands.options.taking import Decorator, options_of, taking

#: Options that choose among many workers and jobs; useless for a single job.
AMONG_MANY: Final = ("pool", "require", "after", "priority", "batch", "shot")

#: A `plateau.farm.model.spec.JobSpec`, made by `takes_spec`; imported when a command runs.
Spec: TypeAlias = Any


def spec_from_options(
    *,
    define: Annotated[
        list[str] | None,
        typer.Option(
            "--define",
            "-D",
            metavar="NAME=VALUE",
            help="Value of the scene's parameter $NAME; may be repeated.",
        ),
    ] = None,
    step: Annotated[
        int | None,
        typer.Option(help="Samples per pixel (spp) between two evaluations.", show_default="100"),
    ] = None,
    slice_spp: Annotated[
        int | None, typer.Option(help="Spp of one slice.", show_default="25")
    ] = None,
    max_spp: Annotated[
        int | None,
        typer.Option(help="Most spp: the cap, at which a job ends.", show_default="10000"),
    ] = None,
    time_limit: Annotated[
        float | None,
        typer.Option(
            help="Seconds until the job ends, from its first slice on; with `render`, from "
            "its submission on.",
            show_default="none",
        ),
    ] = None,
    preset: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Several options at once: paper for the method of Takouachet et al., which is "
            "--rule reverse --allocation frame --seen paper. Options beside it count before it.",
            show_default="none",
        ),
    ] = None,
    rule: Annotated[
        str | None,
        typer.Option(
            help="Rule that ends the job, with its parameters as in jod:target=9.8,min_spp=300.",
            show_default="jod",
            autocompletion=complete.rules,
        ),
    ] = None,
    allocation: Annotated[
        str | None,
        typer.Option(
            help="Where samples go: frame; zones, in which more is left to see, zones:size=32 for "
            "others than 16 pixels; or auto: zones where the rule is jod, the variant has them and "
            "no slice is kept, else the frame.",
            show_default="auto",
        ),
    ] = None,
    denoise: Annotated[
        str | None,
        typer.Option(
            help="Whether the image is denoised, and judged so: none or oidn; oidn:guides=false "
            "for films without albedo and normal.",
            show_default="none",
        ),
    ] = None,
    watch: Annotated[
        list[str] | None,
        typer.Option(
            help="Another rule, which is reported and ends nothing; written the same way; "
            "repeatable.",
            show_default="reverse",
            autocompletion=complete.rules,
        ),
    ] = None,
    seed: Annotated[
        int | None, typer.Option(help="Seed; each draws independent samples.", show_default="0")
    ] = None,
    variant: Annotated[
        str | None,
        typer.Option(
            help="auto;",  # `plateau.commands.options.rule_options` adds those of the renderers
            show_default="auto",
            autocompletion=complete.variants,
        ),
    ] = None,
    sensor: Annotated[
        int | None, typer.Option(help="Index of the scene's sensor.", show_default="0")
    ] = None,
    aov: Annotated[
        list[str] | None,
        typer.Option(
            help="What image.exr has besides colour: albedo, normal, depth, position, uv, shape_id "
            "or primitive_id; may be repeated.",
            autocompletion=complete.aovs,
        ),
    ] = None,
    exr_precision: Annotated[
        str | None,
        typer.Option(help="Values of image.exr: float or half.", show_default="float"),
    ] = None,
    exr_compression: Annotated[
        str | None,
        typer.Option(
            help="Compression of image.exr, without loss: none, rle, zips, zip or piz.",
            show_default="zip",
        ),
    ] = None,
    exposure: Annotated[
        float | None, typer.Option(help="Exposure in EV.", show_default="0")
    ] = None,
    white_luminance: WhiteLuminance = None,
    contrast: Annotated[
        float | None,
        typer.Option(
            help="White of the display over its black, in a dark room; for the rule jod.",
            show_default="1000",
        ),
    ] = None,
    ambient_lux: Annotated[
        float | None,
        typer.Option(help="Light on the display in lux; for the rule jod.", show_default="250"),
    ] = None,
    field_of_view: FieldOfView = None,
    pixels_per_degree: PixelsPerDegree = None,
    seen: Seen = None,
    primaries: Annotated[
        str | None,
        typer.Option(help="Primaries of the display: rec709 or adobe1998.", show_default="rec709"),
    ] = None,
    background: Annotated[
        str | None,
        typer.Option(
            metavar="R,G,B",
            help="Linear colour behind an image with alpha, where it is judged and in PNG files.",
            show_default="0,0,0",
        ),
    ] = None,
    priority: Annotated[
        int | None,
        typer.Option(help="Jobs of higher priority are rendered first.", show_default="0"),
    ] = None,
    pool: Annotated[
        str | None, typer.Option(help="Pool whose workers render the job.", show_default="default")
    ] = None,
    require: Annotated[
        list[str] | None, typer.Option(help="Tag that a worker must have; may be repeated.")
    ] = None,
    after: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ID|BATCH",
            help="Job, or batch, that must have ended well before this one starts; may be "
            "repeated.",
        ),
    ] = None,
    min_spp: Annotated[
        int | None,
        typer.Option(
            help="Fewest spp at which the job may converge, whatever its rule says.",
            show_default="none",
        ),
    ] = None,
    name: Annotated[
        str | None, typer.Option(help="What the job is called.", show_default="as its scene is")
    ] = None,
    batch: Annotated[str | None, typer.Option(help="Batch that the job belongs to.")] = None,
    shot: Annotated[
        str | None,
        typer.Option(
            metavar="FPS",
            help="Judge the jobs of --each as the frames of a shot too, until each "
            "moment has 9.5 JOD in motion; 24:target=9 for another quality, 24:target=none to "
            "judge the shot and give no frame more samples for it.",
        ),
    ] = None,
    keep_slices: Annotated[
        bool,
        typer.Option("--keep-slices", help="Keep every slice, for `judge` and `again`."),
    ] = False,
) -> Spec:
    """The spec that the options describe; other fields have the spec's defaults."""
    return checked(spec_fields(**locals()))


def takes_spec(*, but: Collection[str] = ()) -> Decorator:
    """Give a command the options of a spec, except these, in place of its parameter `spec`."""
    return taking("spec", spec_from_options, options_of(spec_from_options, but=but))


def takes_changes(*, but: Collection[str]) -> Decorator:
    """Give a command the options of a spec, except these, in place of its parameter `changes`.

    The parameter is a dict of the fields that were given.
    """
    taken = options_of(spec_from_options, but=but)
    return taking("changes", spec_fields, list(map(_as_it_was, taken)))


def _as_it_was(option: inspect.Parameter) -> inspect.Parameter:
    """The option; its help names the job's own value as the default."""
    kind, shown = get_args(option.annotation)
    shown = copy(shown)
    if shown.show_default is not True:  # it names the spec's own default
        shown.show_default = "as it was"
    if option.default is False:
        return option.replace(annotation=Annotated[kind | None, shown], default=None)
    return option.replace(annotation=Annotated[kind, shown])
