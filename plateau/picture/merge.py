"""The merged image of a job: the sum of its partials."""

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from plateau.farm.images.channels import Channels
from plateau.farm.images.exr import Partial, Pixels
from plateau.farm.images.view_transform import ViewTransform
from plateau.farm.model.aovs import AOVS, GUIDES
from plateau.farm.model.slices.plan import Plan
from plateau.farm.model.spec import SharedSpec
from plateau.picture.canvas import Canvas, Sampled, canvas_of
from plateau.picture.merged_image import BETWEEN, MergedImage

_INPUT: Final = "input "  #: and the spp: an array of a checkpoint
#: The channels that the first slices alone may have.
_GUIDE_CHANNELS: Final = frozenset(name for guide in GUIDES for name in AOVS[guide].channels)


class Merge(MergedImage):
    """The sum of slices, added in index order in float64.

    So the image depends neither on which workers rendered it nor on the order of their commits.
    """

    @classmethod
    def of(cls, spec: SharedSpec) -> "Merge":
        """Return empty sums for a job of this spec."""
        return cls(
            slice_spp=spec.slice_spp,
            zone_size=Plan.of(spec).size,
            background=spec.view.background,
            has_quarters=spec.by_quarters,
            exposure_ev=spec.view.exposure_ev,
        )

    def add(self, film: Pixels, channels: Channels | None = None) -> None:
        """Add the next slice, which has the whole film.

        Parameters
        ----------
        film
            Its film before normalisation, (height, width, channels) float32.
        channels
            The film's channels; by default R, G, B and W. It may lack a denoiser's guides where the
            slices before have them, and then has their mean.

        Raises
        ------
        ValueError
            The slices before have another size or other channels.
        """
        given = channels or Channels()
        channels = self._checked(given)
        if self._total is not None and film.shape[:2] != self._total.shape[:2]:
            raise ValueError(
                f"slice {self.slices} is {film.shape[1]}×{film.shape[0]} pixels, those before it "
                f"{self._total.shape[1]}×{self._total.shape[0]}"
            )
        if self._total is None:
            self._total = channels.add(None, film)
        else:
            channels.add_part(self._total, film, given)
        seen, part = channels.seen(), film[..., : channels.judged]
        if self.slices % 2 == 0:
            self._even = seen.add(self._even, part)
        if self.has_quarters and self.slices % 4 < 2:
            self._other = seen.add(self._other, part)
            if self.slices % 4 == 0:
                self._first = seen.add(self._first, part)
        self.slices += 1

    def _checked(self, channels: Channels) -> Channels:
        """Return the merge's channels, of which the next slice may lack guides alone."""
        if not self.slices:
            self.channels = channels
        elif channels != self.channels and not self._lacks_guides_alone(channels):
            raise ValueError(
                f"slice {self.slices} has the channels {', '.join(channels.names)}, those before "
                f"it {', '.join(self.channels.names)}: submit the scene as a new job"
            )
        return self.channels

    def _lacks_guides_alone(self, channels: Channels) -> bool:
        needed = set(self.channels.names) - _GUIDE_CHANNELS
        ours = self.channels
        alike = channels.judged == ours.judged and channels.ids == ours.ids
        alike = alike and channels.quotients == ours.quotients
        return alike and needed <= set(channels.names) <= set(self.channels.names)

    def add_partial(self, partial: Partial) -> None:
        """Add the next slice as its worker uploaded it; raises as `add`."""
        if not self.slices:
            self.transform, self.header = partial.transform, partial.header
            self.inputs = partial.inputs
        if self.zone_size is None:
            self.add(partial.pixels, partial.channels)
        else:
            self._add_zones(partial, self.zone_size)
        names = filter(None, (*self.kinds, partial.renderer))
        self.origin = {
            "first_seed": self.origin.get("first_seed", str(partial.first_seed)),
            "last_seed": str(partial.last_seed),
            "variant": partial.variant,
            "renderer": BETWEEN.join(dict.fromkeys(names)),  # each kind once
        }

    def _add_zones(self, partial: Partial, size: int) -> None:
        """Add the next slice of a job that is allocated by zones."""
        channels = self._checked(partial.channels)
        if self._sampled is None:
            canvas = canvas_of(partial, size)
            self._sampled = Sampled.none_of(canvas)
            self._total = np.zeros((*canvas.shape, len(channels.names)))
            self._even = np.zeros((*canvas.shape, channels.judged))
            self._other = np.zeros_like(self._even)
        canvas = self._sampled.canvas
        assert self._total is not None
        assert self._even is not None
        assert self._other is not None
        if partial.border != canvas.border:
            raise ValueError(f"slice {self.slices} has another border than those before it")
        is_even = self.slices % 2 == 0
        for place, part in canvas.parts(partial.pixels, partial.zones):
            if self.slices:
                channels.add_part(self._total[place], part, partial.channels)
            else:  # whose ids stay
                self._total[place] = part
            seen = channels.seen()
            if is_even:
                seen.add(self._even[place], part[..., : channels.judged])
            if self.slices % 4 < 2:
                seen.add(self._other[place], part[..., : channels.judged])
        self._sampled.note(partial.zones, partial.spp, is_even=is_even)
        self.slices += 1

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return the arrays of a checkpoint."""
        assert self._total is not None
        assert self._even is not None
        arrays: dict[str, NDArray[Any]] = {"total": self._total, "even": self._even}
        if self._sampled is not None:
            arrays |= {"spp": self._sampled.spp, "even_spp": self._sampled.even_spp}
        if self.transform is not None:
            arrays["look"] = self.transform.table
        arrays |= {f"{_INPUT}{spp}": film for spp, film in self.inputs.items()}
        more = {"other": self._other, "first": self._first}
        return arrays | {name: one for name, one in more.items() if one is not None}

    def about(self) -> dict[str, Any]:
        """Return what a checkpoint says of its arrays, for JSON."""
        return {
            "channels": self.channels.names,
            "ids": self.channels.ids,
            "quotients": self.channels.quotients,
            "origin": self.origin,
            "header": self.header,
            **({} if self.transform is None else {"look_gain": self.transform.gain}),
            **({} if self._sampled is None else {"canvas": self._sampled.canvas.about()}),
        }

    def restore(
        self, slices: int, arrays: Mapping[str, NDArray[Any]], about: Mapping[str, Any]
    ) -> None:
        """Take over the sums of a checkpoint."""
        self.channels = Channels(about["channels"], about["ids"], about["quotients"])
        self.origin, self.header = about["origin"], about["header"]
        self.slices = slices
        self._total, self._even = arrays["total"], arrays["even"]
        if self.has_quarters or "canvas" in about:
            self._other, self._first = arrays.get("other"), arrays.get("first")
        named = (name for name in arrays if name.startswith(_INPUT))
        self.inputs = {int(name.removeprefix(_INPUT)): arrays[name] for name in named}
        if "look" in arrays:
            self.transform = ViewTransform(arrays["look"], about["look_gain"])
        if "canvas" in about:
            canvas = Canvas.restored(about["canvas"])
            self._sampled = Sampled(canvas, arrays["spp"], arrays["even_spp"])
