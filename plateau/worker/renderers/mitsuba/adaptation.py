"""Changes a parsed scene into one that the farm can render, before Mitsuba makes its plugins.

The farm needs three things that a scene may have otherwise: the ``independent`` sampler (other
samplers repeat their patterns from pass to pass), a float32 RGB or RGBA ``hdrfilm`` (partials are
added up), and an integrator whose samples depend on the seed alone. Notes say what is changed. The
film's size, crop window and reconstruction filter stay. Part of the render child: imports Mitsuba.
"""

from collections.abc import Iterable
from typing import Any

import mitsuba as mi

from plateau.farm.model.renderers import WHOLE
from plateau.farm.model.seeds import SCALAR_BLOCK
from plateau.worker.renderers.contract import SceneError

NO_WEIGHTS = (
    "the integrator '{}' does not sample pixel by pixel, and its passes cannot be added up; use "
    "'path' or 'volpath'"
)

#: The film's parameters that the farm sets, each with why.
_FILM = {
    "file_format": ("openexr", "results are OpenEXR and PNG files"),
    "component_format": ("float32", "the farm adds samples up in float32"),
}

#: Integrator parameters that would make a pass depend on time or split it behind our back.
_IMPURE = {
    "samples_per_pass": "the farm divides the samples into passes itself",
    "timeout": "the farm renders each pass to its end; a job has a time limit of its own",
}

#: What becomes of light in variants that do not render RGB.
_KINDS_OF_LIGHT = {
    "spectral": "spectra are rendered, and stored as linear RGB (Rec. 709)",
    "mono": "one channel of light is rendered, and stored as R, G and B alike",
    "polarized": "polarisation is rendered, and not stored",
}

#: The integrator that stores polarisation, in a film of its own making.
_STOKES = "stokes"

#: The film's pixel formats with alpha.
_WITH_ALPHA = {"rgba", "luminance_alpha", "xyza"}


def adapt(variant: str, nodes: list[Any]) -> tuple[str, ...]:
    """Edit the parsed scene in place; return what was changed, a sentence each, none twice."""
    kinds = {node.type for node in nodes}
    for kind, name in ((mi.ObjectType.Sensor, "sensor"), (mi.ObjectType.Integrator, "integrator")):
        # Mitsuba would invent one, and the person would get an image that they never described.
        if kind not in kinds:
            raise SceneError(f"the scene has no {name}; add a <{name}> to it")
    notes = [note for kind, note in _KINDS_OF_LIGHT.items() if kind in variant]
    if any(node.props.plugin_name() == _STOKES for node in nodes):
        if not variant.startswith("scalar"):
            raise SceneError(WHOLE)
        if "polarized" in variant:
            notes[-1] = "polarisation is rendered, and stored as the AOVs S0 to S3"
    for node in nodes:
        if node.props.plugin_name() == "moment":
            notes += _unwrap(node, nodes)
        if node.type == mi.ObjectType.Sampler:
            notes += _adapt_sampler(node)
        elif node.type == mi.ObjectType.Film:
            notes += _adapt_film(variant, node.props)
        elif node.type == mi.ObjectType.Integrator:
            notes += _adapt_integrator(variant, node.props)
    return tuple(dict.fromkeys(notes))


def _adapt_sampler(node: Any) -> Iterable[str]:
    was = node.props.plugin_name()
    had_seed = node.props.has_property("seed")
    count = node.props["sample_count"] if node.props.has_property("sample_count") else None
    # A new one: the old sampler's other parameters mean nothing to the independent sampler.
    properties = mi.Properties("independent")
    properties.set_id(node.props.id())
    node.props = properties
    if was != "independent":
        yield (
            f"the scene's '{was}' sampler was replaced by 'independent': others repeat their "
            "pattern from pass to pass"
        )
    if had_seed:
        yield "the sampler's seed was ignored: the job's seed is used"
    if count is not None:
        yield (
            f"the sampler's sample_count of {count} was ignored: the job's rule decides how many "
            "samples are rendered (the rule 'fixed' renders as many as you ask for)"
        )


def _adapt_film(variant: str, properties: Any) -> Iterable[str]:
    if properties.plugin_name() != "hdrfilm":
        raise SceneError(
            f"the scene's film is a '{properties.plugin_name()}', and the farm renders 'hdrfilm' "
            "only; change the film's type to that"
        )
    for name in ("width", "height", "crop_width", "crop_height"):
        # Said here: sensors divide by the film's size, and complain of their field of view.
        if properties.has_property(name) and not properties[name]:
            raise SceneError(f"the film's {name} is 0; make it 1 or more")
    asked = str(properties.get("pixel_format", "rgb"))
    has_alpha = asked.lower() in _WITH_ALPHA
    if "mono" in variant:
        properties["pixel_format"] = "luminance_alpha" if has_alpha else "luminance"
    else:
        properties["pixel_format"] = ours = "rgba" if has_alpha else "rgb"
        if asked.lower() != ours:
            yield (
                f"the film's pixel_format was changed from '{asked}' to '{ours}': results are RGB"
            )
    for name, (ours, why) in _FILM.items():
        theirs = properties[name] if properties.has_property(name) else ours
        if str(theirs).lower() != ours:
            yield f"the film's {name} was changed from '{theirs}' to '{ours}': {why}"
        properties[name] = ours
    if properties.has_property("compensate"):
        properties.remove_property("compensate")
        yield "the film's compensate was ignored: Mitsuba no longer has this setting"
    if properties.has_property("sample_border"):
        if properties["sample_border"]:
            yield "the film's sample_border was switched off: the farm samples the image alone"
        # It would enlarge the area that is sampled, and with it the seeds that a pass uses.
        properties["sample_border"] = False


def _unwrap(moment: Any, nodes: list[Any]) -> Iterable[str]:
    """Put the integrator inside a ``moment`` integrator in its place."""
    for name in moment.props.keys():  # noqa: SIM118  (no mapping: it cannot be iterated over)
        value = moment.props[name]
        if isinstance(value, mi.Properties.ResolvedReference):
            inner = nodes[value.index()]
            if inner.type == mi.ObjectType.Integrator:
                moment.props = inner.props
                yield (
                    "the 'moment' integrator was replaced by the integrator inside it: the farm "
                    "estimates the variance from its slices"
                )
                return


def _adapt_integrator(variant: str, properties: Any) -> Iterable[str]:
    if properties.plugin_name() == "ptracer":
        raise SceneError(NO_WEIGHTS.format("ptracer"))
    for name, why in _IMPURE.items():
        if properties.has_property(name):
            properties.remove_property(name)
            yield f"the integrator's {name} was ignored: {why}"
    if variant.startswith("scalar"):
        # Left alone, Mitsuba shrinks the blocks of small films as threads are added, and a
        # block's place in the film decides its seed.
        if properties.has_property("block_size") and properties["block_size"] != SCALAR_BLOCK:
            yield (
                f"the integrator's block_size was changed from {properties['block_size']} to "
                f"{SCALAR_BLOCK}: the farm's seeds are made for blocks of that size"
            )
        properties["block_size"] = SCALAR_BLOCK
