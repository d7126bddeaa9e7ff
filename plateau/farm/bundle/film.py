"""The sensors of a scene, and the size of each one's image."""

import re
from dataclasses import dataclass, field

from plateau.farm.bundle.limits import BundleError, BundleLimits, shown

#: Mitsuba's film where a scene gives no size, in pixels.
_DEFAULT_WIDTH, _DEFAULT_HEIGHT = 768, 576
_INTEGER = re.compile(r"\s*(-?)([0-9]+)\s*", re.ASCII)
#: Scenes written for Mitsuba 0.6 still work; Mitsuba renames their properties as it reads them.
_OLD_NAMES = {
    "cropWidth": "crop_width",
    "cropHeight": "crop_height",
    "cropOffsetX": "crop_offset_x",
    "cropOffsetY": "crop_offset_y",
}


@dataclass(frozen=True)
class Property:
    """A property as the XML has it, after substitution."""

    tag: str
    text: str
    file: str
    line: int


@dataclass
class Film:
    """A `<film>` and its properties."""

    properties: dict[str, Property] = field(default_factory=dict)

    def set(self, name: str, value: Property) -> None:
        """Set a property, by its current name."""
        self.properties[_OLD_NAMES.get(name, name)] = value

    def image_size(self, limits: BundleLimits) -> tuple[int, int]:
        """Return width and height of the image: the film's, or its crop window's.

        Raises
        ------
        BundleError
            A size is not a whole number, the film is empty or too large, or the crop is outside it.
        """
        width = self._pixels("width", _DEFAULT_WIDTH, least=1)
        height = self._pixels("height", _DEFAULT_HEIGHT, least=1)
        if width * height > limits.max_pixels:
            raise self._refusal(
                ("width", "height"),
                f"a film of {width}×{height} pixels is too large: {limits.max_pixels:,} are "
                "allowed; lower its width and height",
            )
        crop_width = self._pixels("crop_width", width, least=1)
        crop_height = self._pixels("crop_height", height, least=1)
        right = self._pixels("crop_offset_x", 0, least=0) + crop_width
        bottom = self._pixels("crop_offset_y", 0, least=0) + crop_height
        if right > width or bottom > height:
            raise self._refusal(
                ("crop_width", "crop_height", "crop_offset_x", "crop_offset_y"),
                f"the crop window ends at ({right}, {bottom}), outside the film of "
                f"{width}×{height} pixels",
            )
        return crop_width, crop_height

    def _pixels(self, name: str, default: int, *, least: int) -> int:
        given = self.properties.get(name)
        if given is None:
            return default
        # Mitsuba takes a film's size only from <integer>, and refuses a plus sign there.
        number = _INTEGER.fullmatch(given.text)
        if given.tag == "integer" and number:
            # Twenty digits are past every limit, and int() is slow for a million.
            value = int(number[1] + (number[2].lstrip("0")[:20] or "0"))
            if value >= least:
                return value
        raise self._refusal(
            (name,),
            f"the film's {name} must be an <integer> of at least {least}, "
            f"not <{given.tag[:40]}> {shown(given.text)}",
        )

    def _refusal(self, names: tuple[str, ...], message: str) -> BundleError:
        """Return the error, placed at the first of these properties that the scene sets."""
        at = next((self.properties[name] for name in names if name in self.properties), None)
        return BundleError(
            "film-size", message, file=at.file if at else None, line=at.line if at else None
        )


@dataclass
class Sensor:
    """A `<sensor>`: its films, and the objects it refers to by id."""

    films: list[Film] = field(default_factory=list)
    references: list[str] = field(default_factory=list)


@dataclass
class Cast:
    """The sensors of a scene in Mitsuba's order, and the films that are shared by id."""

    sensors: list[Sensor] = field(default_factory=list)
    films: dict[str, Film] = field(default_factory=dict)
    aliases: dict[str, str] = field(default_factory=dict)

    def image_size(self, sensor: int, limits: BundleLimits) -> tuple[int, int]:
        """Return width and height, in pixels, of a sensor's image.

        Raises
        ------
        BundleError
            The scene has no such sensor, or its film is refused.
        """
        if not self.sensors:
            raise BundleError("no-sensor", "the scene has no camera; add a <sensor>")
        if not 0 <= sensor < len(self.sensors):
            raise BundleError(
                "no-sensor",
                f"the scene has no sensor {sensor}; it has {len(self.sensors)}, and the first is "
                "sensor 0",
            )
        chosen = self.sensors[sensor]
        shared = [self.films.get(self.aliases.get(one, one)) for one in chosen.references]
        films = [*chosen.films, *(film for film in shared if film is not None)]
        return (films[0] if films else Film()).image_size(limits)
