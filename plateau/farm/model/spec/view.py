"""How a job's image is looked at: a part of its spec."""

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Annotated, Any, Final, Literal

from pydantic import BeforeValidator, ConfigDict, Field

from plateau.farm.model.spec.rule_model import Strict
from plateau.farm.model.spec.texts import COLOUR

#: Pixels in a degree: from pixels that are ten degrees wide to those that no eye resolves.
DENSITIES: Final = (0.1, 1000.0)

_Radiance = Annotated[float, Field(ge=0, le=1e6)]


def _place(
    angle: float, of: str = "pixels_per_degree", *, white: float, contrast: float, lux: float
) -> dict[str, float]:
    return {of: angle, "white_luminance": white, "contrast": contrast, "ambient_lux": lux}


#: Where people look at images: fields of a view by the place's name. A monitor of 24 inches at
#: 60 cm, at 200 % and pixel by pixel; a phone of 6 inches at 40 cm; a film of 1080 lines from three
#: times its height (SMPTE RP 431-2 for white and contrast); and the screen of Takouachet's paper,
#: which the image fills, whatever its size.
PLACES: Final[Mapping[str, Mapping[str, float]]] = MappingProxyType(
    {
        "screen": _place(20, white=200, contrast=1000, lux=250),
        "desk": _place(38, white=200, contrast=1000, lux=250),
        "phone": _place(120, white=500, contrast=10_000, lux=250),
        "cinema": _place(57, white=48, contrast=2000, lux=0),
        "paper": _place(45, "field_of_view_deg", white=100, contrast=1000, lux=64),
    }
)
#: The same for people.
_WORDS: Final = {
    "screen": "on a desk monitor at 200 %",
    "desk": "on a desk monitor, pixel by pixel",
    "phone": "on a phone, pixel by pixel",
    "cinema": "in a cinema, pixel by pixel",
    "paper": "on the paper's screen, of which it fills 45°",
}


class ViewSpec(Strict):
    """The display and the distance at which the image is judged."""

    # Forms have the places from here.
    model_config = ConfigDict(
        json_schema_extra={"x-places": {name: dict(view) for name, view in PLACES.items()}}
    )

    exposure_ev: float = Field(
        default=0.0, ge=-100, le=100, description="exposure in EV (powers of two)"
    )
    white_luminance: float = Field(
        default=200.0, ge=0.01, le=20_000, description="display white in cd/m²"
    )
    contrast: float = Field(
        default=1000.0,
        ge=2,
        le=1e9,
        description="display white over its black in a dark room; for the rule `jod`, as the "
        "model of the other rules does not know it",
    )
    ambient_lux: float = Field(
        default=250.0, ge=0, le=100_000, description="light that falls on the display, for `jod`"
    )
    pixels_per_degree: float = Field(
        default=20.0,
        ge=DENSITIES[0],
        le=DENSITIES[1],
        description="pixels in a degree at the image's centre: about 40 on a desk, where an image "
        "of any size is seen pixel by pixel, and 20 there at 200 %",
    )
    field_of_view_deg: float | None = Field(
        default=None,
        ge=0.0001,
        le=179.9,
        description="angle under which the image's width is seen, in degrees; where it is given, "
        "it counts in place of `pixels_per_degree`",
    )
    primaries: Literal["rec709", "adobe1998"] = Field(
        default="rec709", description="the display's RGB primaries"
    )
    background: Annotated[tuple[_Radiance, _Radiance, _Radiance], COLOUR] = Field(
        default=(0.0, 0.0, 0.0),
        description="linear R, G and B behind an image with alpha, where it is judged and in PNG "
        "files; without alpha it changes nothing, nor does it change image.exr",
    )

    def density(self, width: int) -> float:
        """Pixels in a degree at the centre of an image of this width, as of a flat screen."""
        if self.field_of_view_deg is None:
            return self.pixels_per_degree
        return width / math.degrees(2 * math.tan(math.radians(self.field_of_view_deg) / 2))

    @property
    def words(self) -> str:
        """Where the image is seen, for people: ``on a desk monitor at 200 %``."""
        given = self.of_display()
        for name, place in PLACES.items():
            here = {"field_of_view_deg": None, **place}
            if all(given[field] == value for field, value in here.items()):
                return _WORDS[name]
        fills = self.field_of_view_deg
        angle = f"filling {fills:g}°" if fills else f"at {self.pixels_per_degree:g} pixels a degree"
        return (
            f"{angle}, on a display of {self.white_luminance:g} cd/m² and "
            f"{self.contrast:,g}:1 under {self.ambient_lux:g} lux"
        )

    def of_display(self) -> dict[str, Any]:
        """What `plateau.metric.View` takes: the display and the distance."""
        return self.model_dump(exclude={"background"})


def _of_place(value: Any) -> Any:
    """The view at a place where people look at images, by the place's name."""
    if not isinstance(value, str):
        return value
    if value not in PLACES:
        raise ValueError(f"must be {', '.join(PLACES)}, or an object, not {value!r}")
    return dict(PLACES[value])


FROM_PLACE: Final = BeforeValidator(_of_place)
